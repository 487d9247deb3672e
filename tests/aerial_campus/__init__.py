"""A simulated campus under its own aerial pictures: what was driven, and what the ortho layer is held against."""

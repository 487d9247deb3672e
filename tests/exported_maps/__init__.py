"""Exported maps, and what other programs read out of them."""

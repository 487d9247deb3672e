"""A fleet whose bus shows certificates: an authority, a router of its own process, and sessions of anyone."""

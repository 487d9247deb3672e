"""A place known again: constellations of what was perceived propose it, the points of both times verify it."""

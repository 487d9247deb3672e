"""`trigpoint report`: the newest map version as one page."""

CURVE_DRAWS = 200

"""The tiles service's kernel beside what else lays points on a raster."""

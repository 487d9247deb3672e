"""Sweeps of a world of cylinders and walls, ray by ray."""

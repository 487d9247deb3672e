"""Lays the lidar points of all drives on the ground as rasters, and measures where aerial images lie beside them.

Reads: LandmarkSolved, MapFramePinned, MapSolved, PointsScanned, TrajectorySolved
Writes: (nothing)
"""

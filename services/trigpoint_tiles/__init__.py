"""Lays the lidar points of all drives on the ground as rasters, and measures where aerial images lie beside them.

Reads: MapFramePinned, MapSolved, PointsScanned, TrajectorySolved
Writes: (nothing)
"""

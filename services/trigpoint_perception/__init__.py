"""Finds poles and building corners in lidar sweeps, and how the vehicle moved between them.

Reads: DriveExcluded, DriveIncluded, ImuMeasured, PointsScanned, VehicleDescribed, WheelPairMeasured, WheelSpeedMeasured
Writes: LandmarksPerceived, OdometryMatched
"""

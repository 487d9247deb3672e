"""Finds poles and building corners in lidar sweeps, how the vehicle moved between them, and places it comes
back to.

Reads: DriveExcluded, DriveIncluded, GnssFixReceived, ImuMeasured, PointsScanned, VehicleDescribed, WheelPairMeasured,
WheelSpeedMeasured
Writes: LandmarksPerceived, LoopClosed, LoopsSought, OdometryMatched
"""

"""Accepts what vehicles say and people label: validated, in order, once, kept in the log before anyone is told.

Reads: GnssFixReceived, ImuMeasured, LandmarksDetected, PointsScanned, VehicleDescribed,
WheelPairMeasured, WheelSpeedMeasured
Writes: AnchorLabelled, AnchorRetracted, DriveExcluded, DriveIncluded, EventRefused, GnssFixReceived, ImuMeasured,
LandmarksDetected, MapFramePinned, PointsScanned, VehicleDescribed, WheelPairMeasured, WheelSpeedMeasured
"""

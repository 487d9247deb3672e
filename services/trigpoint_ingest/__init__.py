"""Accepts what vehicles say and people label: validated, in order, once, kept in the log before anyone is told.

Reads: GnssFixReceived, ImuMeasured, LandmarksDetected, VehicleDescribed, WheelPairMeasured, WheelSpeedMeasured
Writes: AnchorLabelled, AnchorRetracted, DriveExcluded, DriveIncluded, EventRefused, GnssFixReceived, ImuMeasured,
LandmarksDetected, MapFramePinned, VehicleDescribed, WheelPairMeasured, WheelSpeedMeasured
"""

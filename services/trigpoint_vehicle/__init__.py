"""Recorded and simulated drives become vehicles' logs, with their truth and anchors kept apart.

Reads: (nothing)
Writes: VehicleDescribed, WheelSpeedMeasured, WheelPairMeasured, ImuMeasured, GnssFixReceived, LandmarksDetected
"""

"""Recorded and simulated drives become vehicles' logs, with their truth and anchors kept apart.

Reads: OdometryCorrected
Writes: VehicleDescribed, WheelSpeedMeasured, WheelPairMeasured, ImuMeasured, GnssFixReceived, LandmarksDetected,
PointsScanned
"""

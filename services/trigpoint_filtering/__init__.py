"""Follows every vehicle online through its wheels, IMU and GNSS, and judges every fix.

Reads: GnssFixReceived, ImuMeasured, MapFramePinned, VehicleDescribed, WheelPairMeasured, WheelSpeedMeasured
Writes: FixJudged, GateAlarmed, PoseFiltered
"""

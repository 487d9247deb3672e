"""Says how good a map is, against withheld fixes, withheld labels and truth, and what stands behind each landmark.

Reads: VehicleDescribed, WheelSpeedMeasured, WheelPairMeasured, ImuMeasured, GnssFixReceived, LandmarksDetected,
LandmarksPerceived, LoopClosed, EventRefused, MapFramePinned, AnchorLabelled, AnchorRetracted, DriveExcluded,
DriveIncluded, FixJudged, PoseFiltered, GateAlarmed, TrajectorySolved, LandmarkSolved, AnchorAssociated,
ImageOffsetSolved, MapSolved
Writes: (nothing)
"""

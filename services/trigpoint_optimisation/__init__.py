"""Solves one factor graph for the whole fleet and says where every landmark and every path lies.

Reads: VehicleDescribed, WheelSpeedMeasured, WheelPairMeasured, ImuMeasured, GnssFixReceived, LandmarksDetected,
LandmarksPerceived, OdometryMatched, LoopClosed, MapFramePinned, AnchorLabelled, AnchorRetracted, DriveExcluded,
DriveIncluded, FixJudged
Writes: MapSolved, TrajectorySolved, LandmarkSolved, AnchorAssociated, ImageOffsetSolved, LabelGainSolved,
OdometryCorrected
"""

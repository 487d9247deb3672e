"""Projects solved map versions into the landmark database, and answers questions about the map.

Reads: AnchorAssociated, AnchorLabelled, AnchorRetracted, ImageOffsetSolved, LabelGainSolved, LandmarkSolved,
LandmarksDetected, MapFramePinned, MapSolved, TrajectorySolved
Writes: (nothing)
"""

"""Projects solved map versions into the landmark database, and answers questions about the map.

Reads: MapFramePinned, AnchorLabelled, MapSolved, TrajectorySolved, LandmarkSolved, AnchorAssociated, ImageOffsetSolved
Writes: (nothing)
"""

"""How sights of a placed drive's tracks enter the growing graph."""

import numpy as np

from trigpoint_optimisation.core.incremental import IncrementalGraph
from trigpoint_optimisation.core.live_state import DriveInMap
from trigpoint_optimisation.core.live_tracks import Sight
from trigpoint_optimisation.core.state import landmark_key


def hang_sight(
    graph: IncrementalGraph, drive: DriveInMap, keyframe: int, track: int, *, sight: Sight, common_sigma_m: float
) -> None:
    """A sight of a track's landmark; where the track's sights share an error, of the pass's own point of it, which
    is off the landmark by that error. `common_sigma_m` is of what no state here stands for, as the sensor's delay."""
    key = landmark_key(drive.of[track])
    if sight.shared_m2 > 0.0:
        if track not in drive.own:
            drive.own[track] = graph.add_pass_point(drive.of[track], sight.shared_m2)
        key = drive.own[track]
    noise = sight.covariance + common_sigma_m**2 * np.eye(2)
    graph.add_sighting(drive.index, keyframe, key, sight.point_m, noise)

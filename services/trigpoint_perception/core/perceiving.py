"""The landmarks of one sweep: ground, segments, poles, walls and corners."""

import math

from trigpoint_perception.core.corners import PerceivedCorner, perceived_corners
from trigpoint_perception.core.ground import heights_above_ground
from trigpoint_perception.core.poles import PerceivedPole, perceived_poles
from trigpoint_perception.core.segments import ordered_sweep, segments_of
from trigpoint_perception.core.sweep import Sweep
from trigpoint_perception.core.tracks import Sight
from trigpoint_perception.core.walls import walls_of
from trigpoint_perception.settings import PerceptionSettings

POLE, CORNER = "pole", "corner"  # kinds, as LandmarkDetection has them


def sights_of(sweep: Sweep, settings: PerceptionSettings) -> tuple[Sight, ...]:
    """The pole-like objects and the building corners of a sweep, in the base frame at its stamp."""
    height_m = heights_above_ground(sweep, settings.ground, range_max_m=settings.sweep.range_max_m)
    ordered = ordered_sweep(sweep, height_m)
    segments = segments_of(ordered, depth_step_m=settings.pole.depth_step_m)
    clearance_m = settings.ground.clearance_m
    poles = perceived_poles(ordered, segments, sweep.sensor_m, settings.pole, clearance_m=clearance_m)
    corners = perceived_corners(walls_of(ordered, sweep.sensor_m, settings.wall), settings.wall)
    return (*map(_pole_sight, poles), *map(_corner_sight, corners))


def _pole_sight(pole: PerceivedPole) -> Sight:
    return Sight(
        kind=POLE,
        landmark_class=pole.landmark_class,
        position_m=pole.centre_m,
        covariance_m2=pole.covariance_m2,
        height_m=pole.top_m,
        diameter_m=2.0 * pole.radius_m,
        points=pole.points,
    )


def _corner_sight(corner: PerceivedCorner) -> Sight:
    return Sight(
        kind=CORNER,
        landmark_class=CORNER,
        position_m=corner.position_m,
        covariance_m2=corner.covariance_m2,
        height_m=corner.top_m,
        diameter_m=math.nan,
        points=corner.points,
    )

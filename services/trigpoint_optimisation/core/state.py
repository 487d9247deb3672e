"""What a solve estimates, as arrays, and its place in gtsam's Values."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import gtsam
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DRIVE_STRIDE = 10**7  # keyframes, knots and the like of one drive have numbers below this


def pose_key(drive: int, keyframe: int) -> int:
    """Pose of a keyframe: Pose2."""
    return int(gtsam.symbol("x", drive * DRIVE_STRIDE + keyframe))


def scale_key(drive: int) -> int:
    """Odometry calibration of a drive (3,): speed scale, turn scale, delay in s."""
    return int(gtsam.symbol("c", drive))


def turn_bias_key(drive: int, knot: int) -> int:
    """Turn bias (1,) from a knot on, in the unit `OdometryCalibration` gives it."""
    return int(gtsam.symbol("b", drive * DRIVE_STRIDE + knot))


def antenna_key(drive: int) -> int:
    """Lever arm (2,) of a drive's antenna: x, y in map metres, base frame."""
    return int(gtsam.symbol("a", drive))


def fix_bias_key(drive: int, knot: int) -> int:
    """Slow error (2,) of a drive's fixes at a knot: x, y in m, map frame."""
    return int(gtsam.symbol("g", drive * DRIVE_STRIDE + knot))


def landmark_key(landmark: int) -> int:
    """Position of a landmark: Point2."""
    return int(gtsam.symbol("l", landmark))


def track_key(track: int) -> int:
    """Where a track's landmark was seen in its pass: Point2."""
    return int(gtsam.symbol("p", track))


def image_key(image: int) -> int:
    """Offset (2,) of an aerial image: x, y in m, map frame."""
    return int(gtsam.symbol("o", image))


def sensor_key(drive: int) -> int:
    """Calibration (6,) of a drive's landmark sensor, see `sighting_factor`."""
    return int(gtsam.symbol("s", drive))


def range_offset_key(drive: int) -> int:
    """Range offsets (2,) in m of what a drive's points show, by RANGE_OFFSETS."""
    return int(gtsam.symbol("r", drive))


RANGE_OFFSETS = 2  # of poles, whose axes points only see from outside, and of corners
SHARED_KINDS = frozenset("cabors")


def shared_keys(values: gtsam.Values) -> list[int]:
    """The keys of states that many factors share: calibrations, lever arms, image offsets."""
    keys = values.keys()
    return [key for key in keys if chr(gtsam.Symbol(key).chr()) in SHARED_KINDS]


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveState:
    """One drive's states. pose (n, 3); scale (3,); turn_bias (m,); antenna_m (2,); fix_bias_m (g, 2);
    sensor (6,), zero for a sensor that needs no calibration; range_offset_m (2,), how much too far poles and corners
    found in points seem."""

    pose: Floats
    scale: Floats
    turn_bias: Floats
    antenna_m: Floats
    fix_bias_m: Floats
    sensor: Floats
    range_offset_m: Floats = field(default_factory=lambda: np.zeros(RANGE_OFFSETS))


@dataclass(frozen=True, slots=True, kw_only=True)
class MapState:
    """All states of a solve. landmark_m (l, 2) and image_m (k, 2): x, y in m, map frame; track_m (t, 2): where each
    track was seen whose sightings share an error, NaN where they share none."""

    drives: tuple[DriveState, ...]
    landmark_m: Floats
    image_m: Floats
    track_m: Floats = field(default_factory=lambda: np.zeros((0, 2)))


def values_of(state: MapState) -> gtsam.Values:
    """The state as gtsam's Values."""
    values = gtsam.Values()
    for d, drive in enumerate(state.drives):
        for k, pose in enumerate(drive.pose):
            values.insert(pose_key(d, k), gtsam.Pose2(*pose))
        values.insert(scale_key(d), drive.scale)
        values.insert(antenna_key(d), drive.antenna_m)
        values.insert(sensor_key(d), drive.sensor)
        values.insert(range_offset_key(d), drive.range_offset_m)
        for k, bias in enumerate(drive.turn_bias):
            values.insert(turn_bias_key(d, k), np.array([bias]))
        for k, fix_bias in enumerate(drive.fix_bias_m):
            values.insert(fix_bias_key(d, k), fix_bias)
    for j, point in enumerate(state.landmark_m):
        values.insert(landmark_key(j), point)
    for track in np.nonzero(np.isfinite(state.track_m).all(axis=1))[0]:
        values.insert(track_key(int(track)), state.track_m[track])
    for i, offset in enumerate(state.image_m):
        values.insert(image_key(i), offset)
    return values


def _vectors(values: gtsam.Values, keys: Sequence[int], size: int) -> Floats:
    return np.array([values.atVector(key) for key in keys]).reshape(-1, size)


def _drive_state(values: gtsam.Values, d: int, like: DriveState) -> DriveState:
    poses = [values.atPose2(pose_key(d, k)) for k in range(len(like.pose))]
    return DriveState(
        pose=np.array([(pose.x(), pose.y(), pose.theta()) for pose in poses]).reshape(-1, 3),
        scale=values.atVector(scale_key(d)),
        turn_bias=_vectors(values, [turn_bias_key(d, k) for k in range(len(like.turn_bias))], 1)[:, 0],
        antenna_m=values.atVector(antenna_key(d)),
        fix_bias_m=_vectors(values, [fix_bias_key(d, k) for k in range(len(like.fix_bias_m))], 2),
        sensor=values.atVector(sensor_key(d)),
        range_offset_m=values.atVector(range_offset_key(d)),
    )


def state_of(values: gtsam.Values, like: MapState) -> MapState:
    """The state that Values hold, of the same sizes as `like`."""
    points = [values.atPoint2(landmark_key(j)) for j in range(len(like.landmark_m))]
    track_m = like.track_m.copy()
    for track in np.nonzero(np.isfinite(track_m).all(axis=1))[0]:
        track_m[track] = values.atPoint2(track_key(int(track)))
    return MapState(
        drives=tuple(_drive_state(values, d, drive) for d, drive in enumerate(like.drives)),
        landmark_m=np.array(points).reshape(-1, 2),
        image_m=_vectors(values, [image_key(i) for i in range(len(like.image_m))], 2),
        track_m=track_m,
    )

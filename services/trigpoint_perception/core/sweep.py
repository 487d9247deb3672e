"""One sweep made ready: what is usable of it, in the base frame, with what its sensor's geometry says."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import EventRejected
from trigpoint.events.scanned import PointsScanned
from trigpoint_perception.settings import SweepSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

UNIT_TOLERANCE = 1e-3  # of a quaternion's length
ELEVATION_STEP_RAD = 0.007  # 0.4 degrees: rings told by elevation where the sensor does not say
MIN_RINGS_BY_NUMBER = 2
SAMPLED_EVERY = 5  # points, coprime with every sensor's number of lasers: enough to know each one's elevation


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """What is usable of a sweep, n points. `point_m` (n, 3) in the base frame, `offset_ns` (n,) after its stamp,
    `ring` (n,) counted from the lowest laser up.

    `azimuth_rad` and `run_m` (n,): each point's direction from the sensor when it was measured, in the base's axes, and
    its horizontal distance.

    `sensor_m` (3,): the sensor in the base frame; `dropped`: points without a return, or out of range.
    """

    point_m: Floats
    azimuth_rad: Floats
    run_m: Floats
    offset_ns: Ints
    ring: Ints
    sensor_m: Floats
    dropped: int


def rotation_of(quaternion: Floats) -> Floats:
    """The rotation matrix (3, 3) of a unit quaternion (4,): x, y, z, w."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def usable_sweep(scanned: PointsScanned, settings: SweepSettings) -> Sweep:
    """The points that came back from within range, in the base frame.

    Raises EventRejected: "empty sweep", "huge sweep", "wrong extrinsics", "no usable points".
    """
    count = len(scanned.point_m)
    _check_count(count, settings)
    rotation = _checked_rotation(scanned, settings)
    point_m = np.asarray(scanned.point_m, dtype=np.float64)
    range_m = np.sqrt(np.einsum("ij,ij->i", point_m, point_m))
    usable = (range_m >= settings.range_min_m) & (range_m <= settings.range_max_m)  # NaN is neither
    kept = int(usable.sum())
    if kept < settings.points_min:
        raise EventRejected(
            "no usable points",
            f"{kept} of {count} points are finite and within {settings.range_min_m:g} to {settings.range_max_m:g} m: "
            f"at least {settings.points_min} are needed",
        )
    own_m = point_m[usable]
    direction_m = own_m @ rotation.T
    return Sweep(
        point_m=direction_m + scanned.sensor_position_m,
        azimuth_rad=np.arctan2(direction_m[:, 1], direction_m[:, 0]),
        run_m=np.hypot(direction_m[:, 0], direction_m[:, 1]),
        offset_ns=scanned.offset_ns[usable].astype(np.int64),
        ring=_rings_by_elevation(own_m, scanned.ring[usable]),
        sensor_m=np.asarray(scanned.sensor_position_m, dtype=np.float64),
        dropped=count - kept,
    )


def _check_count(count: int, settings: SweepSettings) -> None:
    if count == 0:
        raise EventRejected("empty sweep", "the sweep holds no point")
    if count > settings.points_max:
        raise EventRejected("huge sweep", f"{count} points, at most {settings.points_max} are taken")


def _checked_rotation(scanned: PointsScanned, settings: SweepSettings) -> Floats:
    """The sensor's rotation (3, 3) into the base frame; refused where the sensor cannot be mounted so."""
    quaternion = np.asarray(scanned.sensor_orientation, dtype=np.float64)
    position_m = np.asarray(scanned.sensor_position_m, dtype=np.float64)
    length = float(np.linalg.norm(quaternion))
    if not abs(length - 1.0) <= UNIT_TOLERANCE:
        raise EventRejected("wrong extrinsics", f"the orientation's quaternion has length {length:g}, not 1")
    away_m = float(np.abs(position_m).max())
    if not away_m <= settings.mount_limit_m:
        raise EventRejected(
            "wrong extrinsics", f"the sensor is {away_m:g} m from the base, at most {settings.mount_limit_m:g} m is"
        )
    if not position_m[2] > 0.0:
        raise EventRejected("wrong extrinsics", f"the sensor is {position_m[2]:g} m above ground, not above 0 m")
    return rotation_of(quaternion / length)


def _rings_by_elevation(own_m: Floats, ring: NDArray[np.uint16]) -> Ints:
    """Rings (n,) numbered from the lowest up, for points (n, 3) in the sensor's frame."""
    number = ring.astype(np.int64)
    if number.max() - number.min() + 1 < MIN_RINGS_BY_NUMBER:
        number = np.floor(_elevations_rad(own_m) / ELEVATION_STEP_RAD).astype(np.int64)
        return number - int(number.min())
    rings = int(number.max()) + 1
    count = np.bincount(number[::SAMPLED_EVERY], minlength=rings)
    total_rad = np.bincount(number[::SAMPLED_EVERY], _elevations_rad(own_m[::SAMPLED_EVERY]), minlength=rings)
    order = np.argsort(np.where(count > 0, total_rad / np.maximum(count, 1), np.inf), kind="stable")
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return rank[number]


def _elevations_rad(own_m: Floats) -> Floats:
    elevation_rad: Floats = np.arctan2(own_m[:, 2], np.hypot(own_m[:, 0], own_m[:, 1]))
    return elevation_rad

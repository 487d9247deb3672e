"""One sweep made ready: what is usable of it, in the base frame, with what its sensor's geometry says."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint.errors import EventRejected
from trigpoint.events.scanned import PointsScanned
from trigpoint_perception.settings import SweepSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Measured = NDArray[np.float32]

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

    `sensor_m` (3,): the sensor in the base frame.
    """

    point_m: Floats
    azimuth_rad: Floats
    run_m: Floats
    offset_ns: Ints
    ring: Ints
    sensor_m: Floats


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
    limits_m = np.array([settings.range_min_m, settings.range_max_m])
    sensor_m = np.array(scanned.sensor_position_m, dtype=np.float64)
    row, base_m, azimuth_rad, run_m = _taken(scanned.point_m, rotation, sensor_m, limits_m)
    if len(row) < settings.points_min:
        raise EventRejected(
            "no usable points",
            f"{len(row)} of {count} points are finite and within {settings.range_min_m:g} to "
            f"{settings.range_max_m:g} m: at least {settings.points_min} are needed",
        )
    return Sweep(
        point_m=base_m,
        azimuth_rad=azimuth_rad,
        run_m=run_m,
        offset_ns=scanned.offset_ns[row].astype(np.int64),
        ring=_rings_by_elevation(scanned.point_m, row, scanned.ring[row].astype(np.int64)),
        sensor_m=sensor_m,
    )


@compiled
def _taken(
    point_m: Measured, rotation: Floats, sensor_m: Floats, limits_m: Floats
) -> tuple[Ints, Floats, Floats, Floats]:
    """The rows (m,) of points (n, 3) within range, those points in the base frame (m, 3), and their azimuths and
    horizontal distances (m,) from the sensor in the base's axes."""
    size = len(point_m)
    row, base = np.empty(size, np.int64), np.empty((size, 3))
    azimuth, run = np.empty(size), np.empty(size)
    least, most = limits_m[0] ** 2, limits_m[1] ** 2
    kept = 0
    for number in range(size):
        x, y, z = np.float64(point_m[number, 0]), np.float64(point_m[number, 1]), np.float64(point_m[number, 2])
        if least <= x * x + y * y + z * z <= most:  # NaN is not
            row[kept] = number
            ahead = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z
            left = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z
            up = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z
            base[kept, 0], base[kept, 1], base[kept, 2] = ahead + sensor_m[0], left + sensor_m[1], up + sensor_m[2]
            azimuth[kept] = np.arctan2(np.float32(left), np.float32(ahead))  # to 1e-7 rad, in half the time
            run[kept] = np.sqrt(ahead * ahead + left * left)
            kept += 1
    return row[:kept], base[:kept], azimuth[:kept], run[:kept]


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


def _rings_by_elevation(point_m: Measured, row: Ints, ring: Ints) -> Ints:
    """Rings (m,) numbered from the lowest up, for rows (m,) of points (n, 3) in the sensor's frame, as the sensor
    numbers them."""
    if ring.max() - ring.min() + 1 < MIN_RINGS_BY_NUMBER:
        number = np.floor(_elevations_rad(point_m[row].astype(np.float64)) / ELEVATION_STEP_RAD).astype(np.int64)
        return number - int(number.min())
    return _rank(_mean_rises(point_m, row, ring, int(ring.max()) + 1))[ring]


def _rank(value: Floats) -> Ints:
    """The place (n,) of each value in their order."""
    rank = np.empty(len(value), dtype=np.int64)
    rank[np.argsort(value, kind="stable")] = np.arange(len(value))
    return rank


@compiled
def _mean_rises(point_m: Measured, row: Ints, ring: Ints, rings: int) -> Floats:
    """The mean rise per run (rings,) of each laser's points, infinite for one without points."""
    count, total = np.zeros(rings), np.zeros(rings)
    for number in range(0, len(ring), SAMPLED_EVERY):
        x, y, z = point_m[row[number]]
        count[ring[number]] += 1.0
        total[ring[number]] += z / max(np.sqrt(np.float64(x) ** 2 + np.float64(y) ** 2), 1e-9)
    mean = np.full(rings, np.inf)
    for number in range(rings):
        if count[number] > 0.0:
            mean[number] = total[number] / count[number]
    return mean


def _elevations_rad(own_m: Floats) -> Floats:
    elevation_rad: Floats = np.arctan2(own_m[:, 2], np.hypot(own_m[:, 0], own_m[:, 1]))
    return elevation_rad

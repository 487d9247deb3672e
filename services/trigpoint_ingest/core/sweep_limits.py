"""What a sweep of a lidar can be: anything outside is a fault of the sensor, of its mounting or of the message."""

import dataclasses
import math

import numpy as np

from trigpoint.errors import EventRejected
from trigpoint.events.scanned import PointsScanned

POINTS_LIMIT = 300_000  # 128 lasers and 2,048 directions give 262,144
SENSOR_LIMIT_M = 20.0  # from the base to a lidar on the farthest corner of a road train
UNIT_TOLERANCE = 1e-3  # of a quaternion's length: written down with three decimals it is off by up to that
OFFSET_LIMIT_NS = 1_000_000_000  # the slowest spinning lidars turn once in 0.2 s
POINT_LIMIT_M = 1000.0  # beyond the reach of vehicle lidars

EMPTY_SWEEP = "empty sweep"
WRONG_EXTRINSICS = "wrong extrinsics"
CLOCK_JUMPED = "clock jumped in sweep"
TOO_MANY_POINTS = "too many points"
POINT_OUT_OF_RANGE = "point out of range"


def sweep_within_limits(sweep: PointsScanned) -> PointsScanned:
    """The sweep itself, points with an infinite coordinate turned into NaN: nothing came back from there either.

    Raises EventRejected with reason "empty sweep", "too many points", "wrong extrinsics", "clock jumped in sweep" or
    "point out of range".
    """
    if len(sweep.point_m) > POINTS_LIMIT:
        raise EventRejected(TOO_MANY_POINTS, f"{len(sweep.point_m)} points in a sweep, limit {POINTS_LIMIT}")
    _require_extrinsics(sweep)
    _require_offsets(sweep)
    return _required_points(sweep)


def _require_extrinsics(sweep: PointsScanned) -> None:
    position_m, orientation = sweep.sensor_position_m, sweep.sensor_orientation
    distance_m, length = math.hypot(*position_m.tolist()), math.hypot(*orientation.tolist())
    if not distance_m <= SENSOR_LIMIT_M:
        raise EventRejected(
            WRONG_EXTRINSICS,
            f"{sweep.sensor!r} at {_listed(position_m.tolist())} m, {distance_m:.9g} m from the base, "
            f"limit {SENSOR_LIMIT_M:g} m",
        )
    if not abs(length - 1.0) <= UNIT_TOLERANCE:
        raise EventRejected(
            WRONG_EXTRINSICS,
            f"{sweep.sensor!r} has orientation {_listed(orientation.tolist())}, a quaternion of length {length:.9g}: "
            f"1 to within {UNIT_TOLERANCE:g} is needed",
        )


def _listed(values: list[float]) -> str:
    return ", ".join(f"{value:.9g}" for value in values)


def _require_offsets(sweep: PointsScanned) -> None:
    earliest_ns = int(sweep.offset_ns.min(initial=0))
    latest_ns = int(sweep.offset_ns.max(initial=0))
    farthest_ns = latest_ns if latest_ns >= -earliest_ns else earliest_ns
    if abs(farthest_ns) > OFFSET_LIMIT_NS:
        raise EventRejected(
            CLOCK_JUMPED,
            f"a point {farthest_ns / 1e9:.6g} s after its sweep's stamp, limit {OFFSET_LIMIT_NS / 1e9:g} s either way",
        )


def _required_points(sweep: PointsScanned) -> PointsScanned:
    measured = np.asarray(np.isfinite(sweep.point_m).all(axis=1))
    if not measured.any():
        raise EventRejected(EMPTY_SWEEP, f"none of {len(measured)} points was measured: a sweep has at least 1")
    farthest_m = float(np.abs(sweep.point_m[measured]).max())
    if farthest_m > POINT_LIMIT_M:
        raise EventRejected(
            POINT_OUT_OF_RANGE, f"a coordinate of {farthest_m:.9g} m from the sensor, limit {POINT_LIMIT_M:g} m"
        )
    if not np.isinf(sweep.point_m).any():
        return sweep
    point_m = sweep.point_m.copy()
    point_m[~measured] = np.nan
    return dataclasses.replace(sweep, point_m=point_m)

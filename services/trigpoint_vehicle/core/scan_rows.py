"""The scans a manifest names: which files, when each was measured, and where their lidar is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np

from trigpoint.errors import InputError
from trigpoint_vehicle.core.mountings import Mounting, quaternion_of_angles
from trigpoint_vehicle.core.table_manifest import Sweeps, Vehicle
from trigpoint_vehicle.core.table_reading import Reading, stamps_ns

LISTED_COLUMNS = ("scan", "stem")  # of the table that a pattern of files stands for


@dataclass(frozen=True, slots=True)
class ScanRow:
    """One file, from the data's folder on, and its stamp."""

    path: str
    stamp_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanSource:
    """The scans of one lidar, in order of stamp. `mounting` is None where each file says it itself. `origin_m` is
    taken off the coordinates of LAS files; `has_point_times` where these say of each point when it was measured."""

    sensor: str
    mounting: Mounting | None
    rows: tuple[ScanRow, ...]
    origin_m: tuple[float, float, float]
    has_point_times: bool


def scan_source(reading: Reading, vehicle: Vehicle, part: Sweeps) -> ScanSource:
    """The scans of a part. Raises InputError naming file, row and value."""
    table = reading.table(part, vehicle)
    stamps = stamps_ns(table, part.time, reading.clock(vehicle)).tolist()
    rows = [ScanRow(path, stamp_ns) for path, stamp_ns in zip(table.texts(part.scan), stamps, strict=True)]
    return ScanSource(
        sensor=part.sensor,
        mounting=_mounting(part, rows),
        rows=tuple(sorted(rows, key=lambda row: row.stamp_ns)),
        origin_m=part.origin_m,
        has_point_times=part.point_times == "gps_time",
    )


def _mounting(part: Sweeps, rows: Sequence[ScanRow]) -> Mounting | None:
    if part.position_m is None:
        silent = next((row.path for row in rows if PurePath(row.path).suffix.lower() != ".pcd"), None)
        if silent is not None:
            raise InputError(
                f"sweeps of sensor {part.sensor!r} need position_m: {silent} does not say where its lidar is"
            )
        return None
    roll_rad, pitch_rad, yaw_rad = (math.radians(angle) for angle in (part.roll_deg, part.pitch_deg, part.yaw_deg))
    turned = quaternion_of_angles(roll_rad=roll_rad, pitch_rad=pitch_rad, yaw_rad=yaw_rad)
    return Mounting(np.array(part.position_m), turned)

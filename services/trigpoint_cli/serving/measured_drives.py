"""What the log holds of drives beside the map, for the HTTP service: paths by odometry and filter, judged fixes."""

import math
from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.drives import Drive, drives_of
from trigpoint.events.envelope import Envelope
from trigpoint.events.estimated import FixJudged, PoseFiltered
from trigpoint.events.mapped import TrajectorySolved
from trigpoint.events.observed import (
    GnssFixReceived,
    ImuMeasured,
    Observed,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint.geodesy.poses import Pose2, transform_points
from trigpoint.geodesy.projection import MapFrame
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import MAPPED_STREAM, VERDICT_STREAM, logged_verdicts, pinned_frame, vehicle_streams
from trigpoint_cli.data_dir import DataDirectory
from trigpoint_landmarks.http.ports import DrivenPath, JudgedFix, PathSource
from trigpoint_optimisation.core.live_drive import nominal
from trigpoint_optimisation.core.odometry import dead_reckon
from trigpoint_optimisation.settings import OdometrySettings

Floats = NDArray[np.float64]
DriveName = tuple[str, str]
Poses = tuple[NDArray[np.int64], Floats]  # stamps (n,), poses (n, 3) in the map

ODOMETRY = (VehicleDescribed, WheelSpeedMeasured, WheelPairMeasured, ImuMeasured)


class LoggedMeasurements:
    """MeasuredDrives of a data directory's log, opened for each question."""

    def __init__(self, data: DataDirectory) -> None:
        self._data = data

    def frame(self) -> MapFrame | None:
        """The map's frame."""
        with self._data.new_log() as log:
            return pinned_frame(log)

    def paths(self, source: PathSource) -> Sequence[DrivenPath]:
        """The drives' paths."""
        with self._data.new_log() as log:
            filtered = _filtered(log)
            if source == "filtered":
                return [_path(name, stamp_ns, pose) for name, (stamp_ns, pose) in sorted(filtered.items())]
            placed = {**filtered, **_solved(log)}
            drives = (drive for stream in vehicle_streams(log) for drive in _odometry(log, stream))
            return [
                _by_odometry(drive, placed[drive.vehicle, drive.boot_id])
                for drive in drives
                if (drive.vehicle, drive.boot_id) in placed and len(drive.wheels.stamp_ns) > 1
            ]

    def fixes(self) -> Sequence[JudgedFix]:
        """Every fix with a verdict."""
        with self._data.new_log() as log:
            verdicts = {(one.vehicle, one.boot_id, one.fix_sequence): one for one in logged_verdicts(log)}
            found = []
            for stream in vehicle_streams(log):
                for row in log.read(stream, kinds=(GnssFixReceived,)):
                    identity = row.envelope.identity
                    verdict = verdicts.get((identity.source, identity.boot_id, identity.sequence))
                    if verdict is not None:
                        found.append(_fix(cast(Envelope[GnssFixReceived], row.envelope), verdict))
        return sorted(found, key=lambda one: (one.vehicle, one.boot_id, one.fix_sequence))


def _filtered(log: EventLog) -> dict[DriveName, Poses]:
    """The filter's poses of each drive."""
    rows: dict[DriveName, list[tuple[int, float, float, float]]] = {}
    for row in log.read(VERDICT_STREAM, kinds=(PoseFiltered,)):
        event = cast(PoseFiltered, row.envelope.event)
        at = (row.envelope.stamp_ns, event.x_m, event.y_m, event.heading_rad)
        rows.setdefault((event.vehicle, event.boot_id), []).append(at)
    return {name: _poses(sorted(of_drive)) for name, of_drive in rows.items()}


def _poses(rows: list[tuple[int, float, float, float]]) -> Poses:
    stamps = np.array([row[0] for row in rows], dtype=np.int64)
    return stamps, np.array([row[1:] for row in rows], dtype=np.float64)


def _solved(log: EventLog) -> dict[DriveName, Poses]:
    """The newest solved poses of each drive."""
    found: dict[DriveName, Poses] = {}
    for row in log.read(MAPPED_STREAM, kinds=(TrajectorySolved,)):
        event = cast(TrajectorySolved, row.envelope.event)
        if len(event.stamp_ns):
            found[event.vehicle, event.boot_id] = (event.stamp_ns, event.pose)
    return found


def _odometry(log: EventLog, stream: str) -> tuple[Drive, ...]:
    """A vehicle's drives with nothing but what its odometry is made of."""
    return drives_of(cast(Envelope[Observed], row.envelope) for row in log.read(stream, kinds=ODOMETRY))


def _by_odometry(drive: Drive, placed: Poses) -> DrivenPath:
    """The path the wheels describe, taken into the map as a whole: it is right at the first pose that is known."""
    first_ns = int(drive.wheels.stamp_ns[0])
    path = dead_reckon(drive, nominal(first_ns), max_gap_s=OdometrySettings().max_gap_s)
    stamp_ns, pose = placed
    T_odom_base = Pose2(*path.at(stamp_ns[:1])[0].tolist())
    T_map_odom = Pose2(*pose[0].tolist()).compose(T_odom_base.inverse())
    at = np.array([T_map_odom.x_m, T_map_odom.y_m, T_map_odom.heading_rad])
    return _path((drive.vehicle, drive.boot_id), path.stamp_ns, transform_points(at, path.pose[:, :2]))


def _path(name: DriveName, stamp_ns: NDArray[np.int64], pose: Floats) -> DrivenPath:
    return DrivenPath(vehicle=name[0], boot_id=name[1], stamp_ns=stamp_ns, point_m=pose[:, :2])


def _fix(row: Envelope[GnssFixReceived], verdict: FixJudged) -> JudgedFix:
    return JudgedFix(
        vehicle=verdict.vehicle,
        boot_id=verdict.boot_id,
        fix_sequence=verdict.fix_sequence,
        stamp_ns=row.stamp_ns,
        lat_deg=row.event.lat_deg,
        lon_deg=row.event.lon_deg,
        sigma_m=_finite(row.event.sigma_m),
        accepted=verdict.accepted,
        reason=verdict.reason,
        nis=_finite(verdict.nis),
        limit=_finite(verdict.limit),
        innovation_x_m=_finite(verdict.innovation_x_m),
        innovation_y_m=_finite(verdict.innovation_y_m),
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None

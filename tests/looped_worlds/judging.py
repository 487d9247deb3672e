"""Closed loops held against the true paths."""

from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.perceived import LoopClosed
from trigpoint.events.truth import TruthPath
from trigpoint.geodesy.poses import wrap_angles_rad
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import logged_frame
from trigpoint_evaluation.app import read_truth
from trigpoint_optimisation.core.odometry import relative_poses
from trigpoint_perception.app import STREAM

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

WRONG_M, WRONG_RAD = 0.5, np.radians(2.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedLoops:
    """Errors (n, 3) of closed loops, x, y in m and heading in rad, and their normalised squares (n,), 3 on average
    where covariances are what they should be."""

    error: Floats
    nees: Floats

    @property
    def error_m(self) -> Floats:
        """How far each is off (n,)."""
        return np.asarray(np.hypot(self.error[:, 0], self.error[:, 1]), dtype=np.float64)

    @property
    def wrong(self) -> int:
        """How many are off by more than half a metre or two degrees."""
        return int(((self.error_m > WRONG_M) | (np.abs(self.error[:, 2]) > WRONG_RAD)).sum())


class TruePaths:
    """The true poses of vehicles, in a map's frame."""

    def __init__(self, truth_file: Path, frame: MapFrame) -> None:
        self._paths = {path.vehicle: path for path in read_truth(truth_file).paths}
        self._poses = {vehicle: _poses(path, frame) for vehicle, path in self._paths.items()}

    def at(self, vehicle: str, stamp_ns: Ints) -> Floats:
        """True poses (n, 3) at stamps: x, y in map metres, heading in rad, without jumps."""
        path = self._paths[vehicle]
        at_s, wanted_s = ((each - path.stamp_ns[0]) * 1e-9 for each in (path.stamp_ns, stamp_ns))
        return np.column_stack([np.interp(wanted_s, at_s, column) for column in self._poses[vehicle].T])


def judged_loops(log: EventLog, truth_file: Path) -> JudgedLoops:
    """Every loop in a log against the true poses of both its sweeps."""
    frame = logged_frame(log)
    paths, scale = TruePaths(truth_file, frame), (frame.point_scale, frame.point_scale, 1.0)
    errors, nees = [], []
    for logged in log.read(STREAM, kinds=(LoopClosed,)):
        loop = cast(LoopClosed, logged.envelope.event)
        other = paths.at(loop.other_vehicle, np.array([loop.other_stamp_ns]))
        one = paths.at(loop.vehicle, np.array([logged.envelope.stamp_ns]))
        error = np.array([loop.x_m, loop.y_m, loop.heading_rad]) - relative_poses(other, one)[0] / scale
        error[2] = wrap_angles_rad(error[2:])[0]
        errors.append(error)
        nees.append(error @ np.linalg.solve(loop.covariance, error))
    return JudgedLoops(error=np.array(errors).reshape(-1, 3), nees=np.array(nees))


def _poses(path: TruthPath, frame: MapFrame) -> Floats:
    point_m = map_points_from_wgs84(path.lat_deg, path.lon_deg, frame)
    return np.column_stack([point_m, np.unwrap(path.heading_rad)])

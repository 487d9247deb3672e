"""Reads what a log holds of drives, anchors and map versions, and measures it against truth."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.events.drives import Drive
from trigpoint.events.estimated import Estimated, FixJudged, GateAlarmed, PoseFiltered
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.names import NAMED_AT_MOST
from trigpoint.events.observed import EventRefused
from trigpoint.events.solved import SolvedMap
from trigpoint.events.truth import Truth, truth_from_lines
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import logged_maps
from trigpoint_evaluation.core.consistency import GateTruth, JudgedFixes, gate_truth, judged_fixes
from trigpoint_evaluation.core.landmark_truth import LandmarkTruthEvaluation, MappedPoints, evaluate_landmarks
from trigpoint_evaluation.core.path_truth import PathTruthEvaluation, evaluate_paths

Floats = NDArray[np.float64]

ESTIMATED_STREAM, REFUSED_STREAM = STREAM_PATTERNS[FixJudged], STREAM_PATTERNS[EventRefused]


@dataclass(frozen=True, slots=True, kw_only=True)
class StampedPose:
    """A filtered pose and its time."""

    stamp_ns: int
    pose: PoseFiltered


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedEstimates:
    """What filtering said: a verdict a fix, poses and alarms."""

    verdicts: tuple[FixJudged, ...]
    poses: tuple[StampedPose, ...]
    alarms: tuple[GateAlarmed, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluated:
    """A map version and what it was made from, in the map frame."""

    solved: SolvedMap
    frame: MapFrame
    drives: tuple[Drive, ...]
    verdicts: tuple[FixJudged, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthEvaluation:
    """A map version against truth. Parts without truth have no errors (count 0)."""

    landmarks: LandmarkTruthEvaluation
    paths: PathTruthEvaluation
    vehicles: tuple[PathTruthEvaluation, ...]
    gate: GateTruth


def logged_map(log: EventLog, *, as_of: int | None = None) -> SolvedMap:
    """A map version, the newest by default. Raises InputError where there is none, naming those nearest to it."""
    maps = {one.head.map_version: one for one in logged_maps(log)}
    if not maps:
        raise InputError("the log holds no map version: build one first")
    found = maps.get(max(maps) if as_of is None else as_of)
    if found is None:
        nearest = sorted(sorted(maps, key=lambda version: abs(version - (as_of or 0)))[:NAMED_AT_MOST])
        raise InputError(f"map version {as_of} is unknown: the log has {len(maps)}, nearest {nearest}")
    return found


def logged_refusals(log: EventLog) -> tuple[EventRefused, ...]:
    """Every message that was refused."""
    events = (row.envelope.event for row in log.read(REFUSED_STREAM, kinds=(EventRefused,)))
    return tuple(event for event in events if isinstance(event, EventRefused))


def logged_estimates(log: EventLog) -> LoggedEstimates:
    """What filtering appended; of a fix judged twice the last verdict counts."""
    verdicts: dict[tuple[str, str, int], FixJudged] = {}
    poses: dict[tuple[str, str, int], StampedPose] = {}
    alarms = []
    for row in log.read(ESTIMATED_STREAM):
        event, stamp_ns = cast(Estimated, row.envelope.event), row.envelope.stamp_ns
        if isinstance(event, FixJudged):
            verdicts[event.vehicle, event.boot_id, event.fix_sequence] = event
        elif isinstance(event, PoseFiltered):
            poses[event.vehicle, event.boot_id, stamp_ns] = StampedPose(stamp_ns=stamp_ns, pose=event)
        else:
            alarms.append(event)
    return LoggedEstimates(verdicts=tuple(verdicts.values()), poses=tuple(poses.values()), alarms=tuple(alarms))


def read_truth(path: Path) -> Truth:
    """The truth in a file. Raises InputError if it cannot be read as that."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return truth_from_lines(file)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: truth cannot be read: {error}") from error


def mapped_points(solved: SolvedMap) -> MappedPoints:
    """A map version's landmarks as arrays, in its order."""
    landmarks = solved.landmarks
    return MappedPoints(
        point_m=np.array([one.position_m for one in landmarks]).reshape(-1, 2),
        signature=tuple(one.signature for one in landmarks),
        covariance_m2=np.array([one.covariance_m2 for one in landmarks]).reshape(-1, 2, 2),
    )


def true_points(truth: Truth, frame: MapFrame) -> MappedPoints:
    """The true landmarks in the map frame."""
    lat_deg = np.array([one.lat_deg for one in truth.landmarks])
    lon_deg = np.array([one.lon_deg for one in truth.landmarks])
    point_m = map_points_from_wgs84(lat_deg, lon_deg, frame) if len(lat_deg) else np.zeros((0, 2))
    return MappedPoints(point_m=point_m, signature=tuple(one.signature for one in truth.landmarks))


def judged(drives: Sequence[Drive], verdicts: Sequence[FixJudged]) -> tuple[JudgedFixes, ...]:
    """Every drive's verdicts beside its fixes."""
    return tuple(judged_fixes(drive, verdicts) for drive in drives)


def evaluate_truth(evaluated: Evaluated, truth: Truth, *, joint_covariance_m2: Floats | None = None) -> TruthEvaluation:
    """A map version's landmarks and paths, and the filter's verdicts, against truth; nothing is aligned first.

    joint_covariance_m2 (2n, 2n): x and y of each of the map's landmarks in turn.
    """
    solved, frame, drives = evaluated.solved, evaluated.frame, evaluated.drives
    paths, vehicles = evaluate_paths(solved.trajectories, drives, truth, frame)
    return TruthEvaluation(
        landmarks=evaluate_landmarks(
            mapped_points(solved), true_points(truth, frame), joint_covariance_m2=joint_covariance_m2
        ),
        paths=paths,
        vehicles=vehicles,
        gate=gate_truth(judged(drives, evaluated.verdicts), truth.fixes),
    )

"""Why a landmark stands where it does: what was seen of it, what it was tied to, and what people said of either."""

import json
import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from trigpoint.events.corrected import AnchorLabelled, AnchorRetracted, Corrected, DriveExcluded, DriveIncluded
from trigpoint.events.envelope import LogPosition
from trigpoint.events.mapped import TrajectorySolved
from trigpoint.events.observed import LandmarkDetection, VehicleDescribed
from trigpoint.events.perceived import LoopClosed
from trigpoint.geodesy.poses import Pose2
from trigpoint.landmarks.model import Landmark

DriveName = tuple[str, str]  # vehicle, boot
AnchorName = tuple[str, str]  # anchor, image


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """One sweep that saw the landmark, and which of its detections that was: the one nearest to where the map has it,
    `off_m` away; None where the log says too little to tell."""

    vehicle: str
    boot_id: str
    sequence: int
    stamp_ns: int
    position: LogPosition
    range_m: float | None
    bearing_rad: float | None
    off_m: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class TiedAnchor:
    """A label tied to the landmark: why, and what is left of it, label minus landmark minus the image's offset, east
    and north; `offset_m` None for a survey. `position` is that of the association."""

    anchor: str
    image: str
    reason: str
    residual_m: tuple[float, float]
    offset_m: tuple[float, float] | None
    map_version: int
    position: LogPosition


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedLoop:
    """A closed loop and where it stands in the log; `stamp_ns` of its own sweep."""

    position: LogPosition
    stamp_ns: int
    event: LoopClosed


@dataclass(frozen=True, slots=True, kw_only=True)
class TiedLoop:
    """A loop with an end on a leg the landmark was seen from, and what is left of it: loop minus paths, x, y in m and
    heading in rad in the frame of the other sweep's base; near zero where the map holds to it, large where the solve
    let it go, None where a path does not cover its sweep."""

    loop: LoggedLoop
    residual: tuple[float, float, float] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedCorrection:
    """A correction and where it stands in the log; `heeded`: the map version was solved from it."""

    position: LogPosition
    stamp_ns: int
    event: Corrected
    heeded: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """Where the landmark stood in the map versions [map_version, until), and how far that is from where it stood last.

    `moved_m` None where it was not in the map before; `until` None: to this day.
    """

    map_version: int
    until: int | None
    x_m: float
    y_m: float
    moved_m: float | None
    sigma_major_m: float
    sigma_minor_m: float
    observation_count: int
    anchors: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """Everything behind a landmark of a map version; of its observations `missing` are in the log no more."""

    landmark: Landmark
    map_version: int
    sightings: tuple[Sighting, ...]
    missing: int
    anchors: tuple[TiedAnchor, ...]
    loops: tuple[TiedLoop, ...]
    corrections: tuple[LoggedCorrection, ...]
    moves: tuple[Move, ...]


def sweeps_of(rows: Iterable[Landmark]) -> dict[DriveName, list[int]]:
    """The sequences of the sweeps that saw a landmark according to some of its rows, by drive, each once."""
    sweeps: dict[DriveName, dict[int, None]] = {}
    for row in rows:
        for drive, sequences in json.loads(row.provenance).items():
            vehicle, _, boot_id = drive.partition("/")
            sweeps.setdefault((vehicle, boot_id), {}).update(dict.fromkeys(sequences))
    return {drive: list(sequences) for drive, sequences in sweeps.items()}


def rows_behind(history: Sequence[Landmark], *, whole: int, map_version: int) -> list[Landmark]:
    """A landmark's rows, in order of version, that tell together what saw it up to a version: from the one in the
    version `whole`, which is upon no other, or from when it came into the map last."""
    rows: list[Landmark] = []
    for row in reversed([row for row in history if row.valid_from_version <= map_version]):
        if rows and row.valid_to_version != rows[-1].valid_from_version:
            break
        rows.append(row)
        if row.valid_from_version <= whole:
            break
    return rows[::-1]


def moves_of(history: Sequence[Landmark]) -> tuple[Move, ...]:
    """A landmark's rows, in order of version, as moves."""
    before: list[Landmark | None] = [None, *history]
    return tuple(_move(last, row) for last, row in zip(before, history, strict=False))


def _move(last: Landmark | None, row: Landmark) -> Move:
    return Move(
        map_version=row.valid_from_version,
        until=row.valid_to_version,
        x_m=row.x_m,
        y_m=row.y_m,
        moved_m=None if last is None else math.hypot(row.x_m - last.x_m, row.y_m - last.y_m),
        sigma_major_m=row.sigma_major_m,
        sigma_minor_m=row.sigma_minor_m,
        observation_count=row.observation_count,
        anchors=row.anchors,
    )


def base_pose(path: TrajectorySolved | None, stamp_ns: int) -> Pose2 | None:
    """T_map_base at a time; None for a time the path does not cover."""
    if path is None or not len(path.stamp_ns) or not path.stamp_ns[0] <= stamp_ns <= path.stamp_ns[-1]:
        return None
    since_s = (path.stamp_ns - stamp_ns) * 1e-9
    heading = np.unwrap(path.pose[:, 2])
    x_m, y_m, heading_rad = (float(np.interp(0.0, since_s, column)) for column in (*path.pose[:, :2].T, heading))
    return Pose2(x_m, y_m, heading_rad)


def sensor_pose(path: TrajectorySolved | None, described: VehicleDescribed, stamp_ns: int) -> Pose2 | None:
    """T_map_sensor at a time; None for a time the path does not cover."""
    T_map_base = base_pose(path, stamp_ns)
    if T_map_base is None:
        return None
    T_base_sensor = Pose2(
        described.landmark_sensor_x_m, described.landmark_sensor_y_m, described.landmark_sensor_yaw_rad
    )
    return T_map_base.compose(T_base_sensor)


def detection_of(
    landmark: Landmark, detections: Sequence[LandmarkDetection], T_map_sensor: Pose2 | None
) -> tuple[LandmarkDetection | None, float | None]:
    """Which detection of a sweep is the landmark, and how far off it lies: the nearest among those of its signature,
    else of its kind. Without a pose only one that stands alone can be told, and how far off it is cannot."""
    among = [one for one in detections if landmark.signature and one.signature == landmark.signature]
    among = among or [one for one in detections if one.kind == landmark.kind] or list(detections)
    if T_map_sensor is None:
        return (among[0] if len(among) == 1 else None), None
    off_m = [_off_m(landmark, one, T_map_sensor) for one in among]
    nearest = int(np.argmin(off_m)) if off_m else None
    return (None, None) if nearest is None else (among[nearest], off_m[nearest])


def _off_m(landmark: Landmark, seen: LandmarkDetection, T_map_sensor: Pose2) -> float:
    x_m, y_m = T_map_sensor.transform(
        seen.range_m * math.cos(seen.bearing_rad), seen.range_m * math.sin(seen.bearing_rad)
    )
    return math.hypot(x_m - landmark.x_m, y_m - landmark.y_m)


def corrections_behind(
    corrections: Iterable[tuple[LogPosition, int, Corrected]],
    *,
    anchors: Collection[AnchorName],
    drives: Collection[DriveName],
    read: int,
) -> tuple[LoggedCorrection, ...]:
    """Of all corrections (position, stamp in ns, event), those of these anchors and drives; the version `read` so
    many of all. An anchor without image that no survey labelled is one written before images were named: any image's.
    """
    rows = tuple(corrections)
    labelled = {(event.anchor, event.image) for _, _, event in rows if isinstance(event, AnchorLabelled)}
    nameless = {anchor for anchor, image in anchors if not image and (anchor, image) not in labelled}
    about = {name for name in labelled if name in anchors or name[0] in nameless}
    return tuple(
        LoggedCorrection(position=position, stamp_ns=stamp_ns, event=event, heeded=position.number < read)
        for position, stamp_ns, event in rows
        if _is_about(event, about, drives)
    )


def _is_about(event: Corrected, anchors: Collection[AnchorName], drives: Collection[DriveName]) -> bool:
    if isinstance(event, AnchorLabelled | AnchorRetracted):
        return (event.anchor, event.image) in anchors
    assert isinstance(event, DriveExcluded | DriveIncluded)
    return (event.vehicle, event.boot_id) in drives

"""Where live optimisation goes on: the newest map version, where drives were, and how far the log was taken in."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import cast

from trigpoint.events.envelope import Envelope
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.mapped import LandmarkSolved, Mapped, MapSolved, OdometryCorrected, TrajectorySolved
from trigpoint.events.observed import VehicleDescribed
from trigpoint.events.solved import closed_versions
from trigpoint.logs.perceived_readings import PERCEIVED_STREAM
from trigpoint.logs.ports import EventLog, LoggedEvent
from trigpoint.logs.readings import VERDICT_STREAM, vehicle_streams
from trigpoint_optimisation.app import STREAM
from trigpoint_optimisation.core.live_fleet import Start, corrected_start, solved_start

ODOMETRY_STREAM = STREAM_PATTERNS[OdometryCorrected]
TAIL = 20_000  # corrections looked through for the newest of each drive: an hour of two vehicles

DriveName = tuple[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Resumed:
    """The newest map version (0: none) with its landmarks, its inputs and its newest measurement, the inputs of the
    newest whole solve, where drives were and until when they were told so, and the numbers to read on from."""

    version: int = 0
    landmarks: tuple[LandmarkSolved, ...] = ()
    anchor_count: int = 0
    stamp_ns: int = 0
    inputs: tuple[tuple[str, int], ...] = ()
    whole_inputs: tuple[tuple[str, int], ...] = ()
    starts: Mapping[DriveName, Start] = field(default_factory=dict)
    said_ns: Mapping[DriveName, int] = field(default_factory=dict)
    vehicle_numbers: Mapping[str, int] = field(default_factory=dict)
    verdict_number: int = 0
    perceived_number: int = 0


def resumed(log: EventLog) -> Resumed:
    """What the log says of it."""
    begun = {stream: _newest_boot(log, stream) for stream in vehicle_streams(log)}
    vehicle_numbers = {stream: number for stream, (number, _) in begun.items()}
    perceived_number = _first_perceived(log, {(stream, boot_id) for stream, (_, boot_id) in begun.items()})
    newest, whole, first_number = _heads(log)
    if newest is None or whole is None:
        return Resumed(vehicle_numbers=vehicle_numbers, perceived_number=perceived_number)
    stamp_ns, head = newest.envelope.stamp_ns, cast(MapSolved, newest.envelope.event)
    before = cast(MapSolved, whole.envelope.event)
    landmarks, paths = _parts(log, first_number)
    said = _corrections(log)
    starts = {name: solved_start(path) for name, path in paths.items() if len(path.stamp_ns)}
    for name, (said_ns, event) in said.items():
        if name not in starts or said_ns > starts[name].stamp_ns:
            starts[name] = corrected_start(said_ns, event)
    return Resumed(
        version=head.map_version,
        landmarks=tuple(landmarks.values()),
        anchor_count=head.anchor_count,
        stamp_ns=stamp_ns,
        inputs=head.inputs,
        whole_inputs=() if before.method == "incremental" else before.inputs,
        starts=starts,
        said_ns={name: said_ns for name, (said_ns, _) in said.items()},
        vehicle_numbers=vehicle_numbers,
        verdict_number=dict(head.inputs).get(VERDICT_STREAM, 0),
        perceived_number=perceived_number,
    )


def needed_of(event: Mapped) -> Mapped:
    """What going on from a version needs of one of its events: where a landmark is, and where a path ends."""
    if isinstance(event, LandmarkSolved):
        return replace(event, observations=())
    if isinstance(event, TrajectorySolved):
        end = slice(-1, None)
        return replace(
            event,
            stamp_ns=event.stamp_ns[end].copy(),
            pose=event.pose[end].copy(),
            covariance=event.covariance[end].copy(),
        )
    return event


def _heads(log: EventLog) -> tuple[LoggedEvent | None, LoggedEvent | None, int]:
    """The newest head, that of the newest whole version or else the first, and the number of its version's first
    event."""
    newest: LoggedEvent | None = None
    whole: LoggedEvent | None = None
    first_number = 0
    for row in log.read(STREAM, kinds=(MapSolved,)):
        if whole is None or not cast(MapSolved, row.envelope.event).base_version:
            whole, first_number = row, 0 if newest is None else newest.position.number + 1
        newest = row
    return newest, whole, first_number


def _parts(log: EventLog, first_number: int) -> tuple[dict[str, LandmarkSolved], dict[DriveName, TrajectorySolved]]:
    """The landmarks of the newest version and the paths of the newest whole one, whose first event has this number."""
    landmarks: dict[str, LandmarkSolved] = {}
    paths: dict[DriveName, TrajectorySolved] = {}
    kinds = (LandmarkSolved, TrajectorySolved, MapSolved)
    logged = (cast(Envelope[Mapped], row.envelope) for row in log.read(STREAM, first_number=first_number, kinds=kinds))
    rows = (replace(row, event=needed_of(row.event)) for row in logged)
    for head, events in closed_versions(rows):
        landmarks |= {event.landmark: event for event in events if isinstance(event, LandmarkSolved)}
        paths |= {(event.vehicle, event.boot_id): event for event in events if isinstance(event, TrajectorySolved)}
        for name in head.removed:
            landmarks.pop(name, None)
    return landmarks, paths


def _corrections(log: EventLog) -> dict[DriveName, tuple[int, OdometryCorrected]]:
    """The newest correction of each drive, and its stamp."""
    first = max(log.next_number(ODOMETRY_STREAM) - TAIL, 0)
    newest: dict[DriveName, tuple[int, OdometryCorrected]] = {}
    for row in log.read(ODOMETRY_STREAM, first_number=first):
        event = cast(OdometryCorrected, row.envelope.event)
        newest[event.vehicle, event.boot_id] = row.envelope.stamp_ns, event
    return newest


def _first_perceived(log: EventLog, boots: set[tuple[str, str]]) -> int:
    """The number of the first event perception said of the time since one of the boots, by stream, began."""
    starts = [boot.start_ns for stream, boot_id in boots for boot in log.boots(stream) if boot.boot_id == boot_id]
    if not starts:
        return 0
    first = next(log.read(PERCEIVED_STREAM, from_ns=min(starts)), None)
    return log.next_number(PERCEIVED_STREAM) if first is None else first.position.number


def _newest_boot(log: EventLog, stream: str) -> tuple[int, str]:
    """The number of the first event of a stream's newest boot that describes itself, and the boot."""
    number, boot_id = 0, ""
    for row in log.read(stream, kinds=(VehicleDescribed,)):
        if row.envelope.identity.boot_id != boot_id:
            number, boot_id = row.position.number, row.envelope.identity.boot_id
    return number, boot_id

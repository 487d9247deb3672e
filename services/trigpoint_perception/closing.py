"""Loops closed from a log: every drive's places sought among those of the drives perceived before it, and its own."""

import hashlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import cast

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import ServiceError
from trigpoint.events.codec import Event
from trigpoint.events.corrected import excluded_drives
from trigpoint.events.envelope import Envelope
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.perceived import (
    LandmarksPerceived,
    LoopClosed,
    LoopsSought,
    OdometryMatched,
    Perceived,
    RefusedLoops,
    SoughtDrive,
)
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import Progress, in_silence, logged_corrections
from trigpoint.workers import Workers
from trigpoint_perception.app import APPENDED_TOGETHER, STREAM
from trigpoint_perception.core.closures.clouds import Cloud, cloud_around, rows_around
from trigpoint_perception.core.closures.runs import Run, runs_of
from trigpoint_perception.core.closures.seeking import Attempt, attempts
from trigpoint_perception.core.closures.settings import ClosureSettings
from trigpoint_perception.core.closures.submaps import submaps_of
from trigpoint_perception.core.following import NumberedSweep
from trigpoint_perception.core.publication import numbered
from trigpoint_perception.settings import PerceptionSettings
from trigpoint_perception.whereabouts import Whereabouts

STREAM_OF_VEHICLE = STREAM_PATTERNS[PointsScanned]

DriveName = tuple[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopReport:
    """What became of a drive's loops, by all searches: places proposed, verified, refused by reason; events appended
    now; `drives_apart`: drives before it in whose places its own were not sought, since they cannot have met."""

    vehicle: str
    boot_id: str
    proposed: int
    verified: int
    refused: tuple[tuple[str, int], ...]
    appended: int
    drives_apart: int


@dataclass(slots=True)
class _Told:
    """What perception told of a drive: sweeps and motions by its newest settings, and searches for loops by these."""

    boot_id: str = ""
    motions: list[OdometryMatched] = field(default_factory=list)
    stamp_ns: list[int] = field(default_factory=list)
    seen: list[LandmarksPerceived] = field(default_factory=list)
    closed: list[LoopClosed] = field(default_factory=list)
    searches: list[LoopsSought] = field(default_factory=list)

    def take(self, envelope: Envelope[Perceived], closing_boot_id: str) -> None:
        """One more event of the drive."""
        event, boot_id = envelope.event, envelope.identity.boot_id
        if isinstance(event, LoopClosed | LoopsSought):
            if boot_id == closing_boot_id:
                self._take_loop(event)
            return
        if boot_id != self.boot_id:
            self.boot_id, self.motions, self.stamp_ns, self.seen = boot_id, [], [], []
        if isinstance(event, LandmarksPerceived):
            self.seen.append(event)
        else:
            self.motions.append(event)
            self.stamp_ns.append(envelope.stamp_ns)

    def _take_loop(self, event: LoopClosed | LoopsSought) -> None:
        if isinstance(event, LoopClosed):
            self.closed.append(event)
        else:
            self.searches.append(event)

    @property
    def swept_ns(self) -> NDArray[np.int64]:
        """When the matched sweeps were."""
        return np.array([*self.stamp_ns, *(each.from_stamp_ns for each in self.motions)], dtype=np.int64)

    @property
    def sought(self) -> set[DriveName]:
        """The drives among which this one's places were sought already."""
        return {(each.vehicle, each.boot_id) for search in self.searches for each in search.among}


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """A drive's runs, and those of each drive its places are yet to be sought among."""

    name: DriveName
    runs: tuple[Run, ...]
    among: tuple[tuple[DriveName, tuple[Run, ...]], ...]


def closing_boot_id(vehicle: str, boot_id: str, settings: ClosureSettings) -> str:
    """The boot under which a drive's loops are numbered: the same for the same drive and settings, perception's too."""
    digest = hashlib.sha256(f"loops|{vehicle}|{boot_id}|{settings}|{PerceptionSettings()}".encode()).hexdigest()[:12]
    return f"{vehicle[:40]}-{digest}"


def close_loops(
    log: EventLog,
    open_log: Callable[[], EventLog],
    settings: ClosureSettings | None = None,
    *,
    some: Workers,
    progress: Progress = in_silence,
) -> tuple[LoopReport, ...]:
    """The places of every perceived drive that is not excluded sought among those of drives perceived before it and its
    own, by some workers, each of which opens the log to read points; told of in `log`; again: nothing is appended
    twice, and a drive that came since is sought for alone. Drives whose fixes say that they cannot have met are passed
    over.

    A drive that cannot be read costs no other. Raises AppendFailed, and once all others are done ServiceError.
    """
    chosen = settings or ClosureSettings()
    told = _told_of(log, chosen)
    searches, apart = _due(told, Whereabouts(log, {name: each.swept_ns for name, each in told.items()}))
    appended: Counter[DriveName] = Counter()
    failures = []
    work = partial(found_in, open_log, chosen)
    for number, done in enumerate(some.each(work, searches), start=1):
        name = done.item.name
        if done.result is None:
            failures.append(f"drive {name[1]} of {name[0]}: {done.error}")
            continue
        appended[name] = _append(log, done.item, done.result, told[name], chosen)
        progress(number, len(searches))
    if failures:
        raise ServiceError(f"loops of {len(failures)} of {len(searches)} drives not closed: {'; '.join(failures)}")
    return tuple(_report(name, told[name], appended=appended[name], apart=apart[name]) for name in told)


def _told_of(log: EventLog, settings: ClosureSettings) -> dict[DriveName, _Told]:
    """What was told of each drive that is not excluded, in the order of the first event."""
    excluded = excluded_drives(logged_corrections(log))
    told: dict[DriveName, _Told] = {}
    for logged in log.read(STREAM):
        envelope = cast(Envelope[Perceived], logged.envelope)
        name = (envelope.event.vehicle, envelope.event.boot_id)
        if name not in excluded:
            told.setdefault(name, _Told()).take(envelope, closing_boot_id(*name, settings))
    return told


def _due(told: dict[DriveName, _Told], whereabouts: Whereabouts) -> tuple[list[Search], Counter[DriveName]]:
    """Each drive with those before it, and itself, among which its places were not sought yet; and how many of these
    were passed over, as they cannot have met."""
    runs: dict[DriveName, tuple[Run, ...]] = {}

    def runs_by(name: DriveName) -> tuple[Run, ...]:
        if name not in runs:
            runs[name] = tuple(runs_of(told[name].motions, told[name].stamp_ns, told[name].seen))
        return runs[name]

    searches, names, apart = [], list(told), Counter[DriveName]()
    for number, name in enumerate(names):
        sought = told[name].sought
        open_yet = [other for other in names[: number + 1] if other not in sought]
        among = [other for other in open_yet if other == name or not whereabouts.apart(name, other)]
        apart[name] = len(open_yet) - len(among)
        if among:
            others = tuple((other, runs_by(other)) for other in among)
            searches.append(Search(name=name, runs=runs_by(name), among=others))
    return searches, apart


def found_in(open_log: Callable[[], EventLog], settings: ClosureSettings, search: Search) -> list[Attempt]:
    """What became of every place that is proposed in a search."""
    log = open_log()
    try:
        cloud_at = partial(_cloud_at, log, settings)
        ones = submaps_of(search.runs, settings.submap)
        others = (ones if name == search.name else submaps_of(runs, settings.submap) for name, runs in search.among)
        return list(attempts(ones, others, cloud_at, settings))
    finally:
        log.close()


def _cloud_at(log: EventLog, settings: ClosureSettings, run: Run, row: int) -> Cloud:
    """The points around a sweep, read from the log: only the sweeps around it are."""
    rows = rows_around(run, row, settings.verification)
    wanted = set(run.sequence[rows].tolist())
    sweeps = []
    for logged in log.read(
        STREAM_OF_VEHICLE.format(vehicle=run.vehicle),
        from_ns=int(run.stamp_ns[rows[0]]),
        until_ns=int(run.stamp_ns[rows[-1]]) + 1,
        kinds=(PointsScanned,),
    ):
        envelope = cast(Envelope[PointsScanned], logged.envelope)
        identity = envelope.identity
        if identity.boot_id == run.boot_id and identity.sequence in wanted and envelope.event.sensor == run.sensor:
            sweeps.append(NumberedSweep(sequence=identity.sequence, stamp_ns=envelope.stamp_ns, scanned=envelope.event))
    return cloud_around(sweeps, run, row, settings.verification, PerceptionSettings())


def _append(log: EventLog, search: Search, found: Sequence[Attempt], told: _Told, settings: ClosureSettings) -> int:
    """The closures that were not told of before a search was cut short appended, and the search; how many events."""
    known = {_pair(each) for each in told.closed}
    fresh = [(each.stamp_ns, each.closed) for each in found if each.closed and _pair(each.closed) not in known]
    refused = Counter(each.refusal for each in found if each.refusal)
    sought = LoopsSought(
        vehicle=search.name[0],
        boot_id=search.name[1],
        among=tuple(SoughtDrive(vehicle=vehicle, boot_id=boot_id) for (vehicle, boot_id), _ in search.among),
        proposed=len(found),
        verified=sum(each.closed is not None for each in found),
        refused=tuple(RefusedLoops(reason=reason, count=count) for reason, count in sorted(refused.items())),
    )
    last_ns = max((int(run.stamp_ns[-1]) for run in search.runs), default=0)
    new: list[tuple[int, LoopClosed | LoopsSought]] = [*fresh, (last_ns, sought)]
    rows = numbered(
        new,
        boot_id=closing_boot_id(*search.name, settings),
        first_sequence=len(told.closed) + len(told.searches),
    )
    for first in range(0, len(rows), APPENDED_TOGETHER):
        log.append(STREAM, cast(list[Envelope[Event]], list(rows[first : first + APPENDED_TOGETHER])))
    told.closed += [closed for _, closed in fresh]
    told.searches.append(sought)
    return len(rows)


def _pair(closed: LoopClosed) -> tuple[object, ...]:
    """Which two sweeps a closure is of."""
    other = (closed.other_vehicle, closed.other_boot_id, closed.other_sensor, closed.other_sequence)
    return closed.sensor, closed.sweep_sequence, *other


def _report(name: DriveName, told: _Told, *, appended: int, apart: int) -> LoopReport:
    refused: Counter[str] = Counter()
    for search in told.searches:
        refused.update({each.reason: each.count for each in search.refused})
    return LoopReport(
        vehicle=name[0],
        boot_id=name[1],
        proposed=sum(search.proposed for search in told.searches),
        verified=sum(search.verified for search in told.searches),
        refused=tuple(sorted(refused.items())),
        appended=appended,
        drives_apart=apart,
    )

"""Optimisation at work on a log that grows: keyframe by keyframe, and the whole map anew when that is called for."""

import logging
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from hashlib import blake2b
from itertools import chain, islice
from typing import cast

from trigpoint.bus.event_messages import event_message
from trigpoint.bus.ports import Bus, News
from trigpoint.events.codec import Event
from trigpoint.events.corrected import (
    AnchorLabelled,
    AnchorRetracted,
    DriveExcluded,
    DriveIncluded,
    excluded_drives,
)
from trigpoint.events.drives import DRIVE_KINDS
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.estimated import FixJudged
from trigpoint.events.keys import DEFAULT_MAP, DEFAULT_ROOT, KEY_VERSION, STREAM_PATTERNS, key_of
from trigpoint.events.mapped import LandmarkSolved, Mapped, MapSolved, OdometryCorrected, TrajectorySolved
from trigpoint.events.observed import Observed
from trigpoint.geodesy.projection import MapFrame
from trigpoint.logs.following import StreamFollower
from trigpoint.logs.perceived_readings import PERCEIVED_STREAM
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import (
    LABEL_STREAM,
    VERDICT_STREAM,
    is_vehicle_stream,
    logged_corrections,
    pinned_frame,
)
from trigpoint.observability.backlog import Backlog
from trigpoint.observability.metrics import Instruments
from trigpoint_optimisation.app import SOURCE, STREAM, boot_id_of, envelopes, input_positions
from trigpoint_optimisation.core.live_fleet import LiveFleet
from trigpoint_optimisation.core.live_state import DriveName, DrivePlace
from trigpoint_optimisation.live_perceived import PerceivedLandmarks
from trigpoint_optimisation.resuming import Resumed, needed_of, resumed
from trigpoint_optimisation.settings import SolveSettings, settings_json
from trigpoint_optimisation.whole_solve import WholeSolve, WholeSolver

BATCH = 1000  # events taken at a time
IDLE_S = 0.02  # between two looks at a log without news
SOLVING = 2  # times its limit the graph may grow while the whole map is being solved, which may take long
TOGETHER = 64  # events of a version appended at a time, fewer where they have more than
TOGETHER_PARTS = 4_000  # observations and poses: what they are while they are written is hundreds of bytes each
METHOD = "incremental"
ODOMETRY_STREAM = STREAM_PATTERNS[OdometryCorrected]
CORRECTIONS = (AnchorLabelled, AnchorRetracted, DriveExcluded, DriveIncluded)

logger = logging.getLogger(__name__)


class LiveOptimisation:
    """Follows the log, appends corrections and map versions, then publishes them. Close it.

    Messages on the bus only wake it up. What it appended is where it goes on after a restart. `names` are the root of
    the keys and the map's name.
    """

    def __init__(
        self,
        log: EventLog,
        solver: WholeSolver,
        bus: Bus | None = None,
        *,
        settings: SolveSettings | None = None,
        names: tuple[str, str] = (DEFAULT_ROOT, DEFAULT_MAP),
        instruments: Instruments | None = None,
    ) -> None:
        self._log, self._solver, self._bus = log, solver, bus
        self._root, self._map_name = names
        self._settings = settings or SolveSettings()
        self._instruments = instruments or Instruments("optimisation")
        self._backlog = Backlog(self._instruments)
        self._news: News | None = None if bus is None else bus.news(f"{self._root}/{KEY_VERSION}/veh/*/obs/**")
        self._fleet: LiveFleet | None = None
        self._ready = False

    @property
    def ready(self) -> bool:
        """Whether everything in the log when it began is taken in."""
        return self._ready

    @property
    def pose_count(self) -> int:
        """How many poses the growing graph has."""
        return 0 if self._fleet is None else self._fleet.map.pose_count

    def run(self, stop: threading.Event) -> None:
        """Works until told to stop. Raises AppendFailed, LogDamaged, ServiceError where the solving process died."""
        while not stop.is_set():
            if not self.step():
                self._wait(stop)

    def close(self) -> None:
        """Nothing more is heard or solved; again: no effect."""
        self._ready = False
        self._solver.close()
        if self._news is not None:
            self._news.close()

    def step(self) -> bool:
        """Whether there was something to do; what is due is appended, and published."""
        if self._fleet is None and not self._begin():
            self._ready = True  # nothing can be placed before a frame is pinned
            return False
        taken = self._take()
        self._ready = self._ready or not taken
        worked = taken or self._catch_up()
        self._solve()
        return self._tell() or worked

    def _catch_up(self) -> bool:
        """Whether something waited that was taken in before."""
        assert self._fleet is not None, "begun before"
        began_s = time.perf_counter()
        waited, places = self._fleet.catch_up()
        if waited:
            self._instruments.update_seconds.observe(time.perf_counter() - began_s)
        self._correct(places)
        return waited

    def _wait(self, stop: threading.Event) -> None:
        if self._news is None:
            stop.wait(IDLE_S)
        else:
            self._news.wait(IDLE_S)

    def _begin(self) -> bool:
        frame = pinned_frame(self._log)
        if frame is None:
            return False
        state = resumed(self._log)
        self._frame: MapFrame = frame
        self._excluded = excluded_drives(logged_corrections(self._log))
        self._fleet = LiveFleet(
            frame, self._settings, base=state.landmarks, starts=state.starts, excluded=self._excluded
        )
        self._measured = StreamFollower(
            self._log, is_vehicle_stream, checkpoint=state.vehicle_numbers, kinds=DRIVE_KINDS
        )
        self._judged = StreamFollower(
            self._log, [VERDICT_STREAM], checkpoint={VERDICT_STREAM: state.verdict_number}, kinds=(FixJudged,)
        )
        self._perceived = PerceivedLandmarks(
            self._log, first_number=state.perceived_number, updated=self._instruments.update_seconds.observe
        )
        self._corrected = StreamFollower(
            self._log, [LABEL_STREAM], checkpoint={LABEL_STREAM: self._log.next_number(LABEL_STREAM)}
        )
        self._go_on_from(state)
        logger.info("going on", extra={"map_version": state.version, "landmarks": len(state.landmarks)})
        return True

    def _go_on_from(self, state: Resumed) -> None:
        self._version, self._version_inputs = state.version, dict(state.inputs)
        self._anchor_count = state.anchor_count
        self._solved_inputs, self._tried_inputs = state.whole_inputs, state.whole_inputs
        self._said_ns = dict(state.said_ns)
        self._boots: dict[DriveName, tuple[str, int]] = {}
        self._newest_ns = state.stamp_ns
        self._told_s = self._solved_s = self._news_s = time.monotonic()
        known = dict(state.whole_inputs).get(LABEL_STREAM, 0)
        self._correction_s = self._news_s if self._log.next_number(LABEL_STREAM) > known else None

    def _take(self) -> bool:
        """Whether anything was new; corrections of odometry are appended."""
        assert self._fleet is not None, "begun before"
        perceived, found = self._perceived.take(self._fleet, measurements_wait=self._measured.lag > 0)
        places = {(place.vehicle, place.boot_id): place for place in found}
        rows = self._measured.take(BATCH)
        began_s = time.perf_counter()
        for row in rows:
            envelope = cast(Envelope[Observed], row.envelope)
            self._newest_ns = max(self._newest_ns, envelope.stamp_ns)
            for place in self._taken(self._fleet, envelope):
                places[place.vehicle, place.boot_id] = place
                self._instruments.update_seconds.observe(time.perf_counter() - began_s)
                began_s = time.perf_counter()
        for (vehicle, outcome), sweeps in self._fleet.take_late().items():
            self._instruments.late_sweeps.labels(vehicle, outcome).inc(sweeps)
        verdicts = self._judged.take(BATCH)
        for row in verdicts:
            self._fleet.judged(cast(FixJudged, row.envelope.event))
        self._correct(list(places.values()))
        if self._corrected.take(BATCH):
            self._correction_s = time.monotonic()
        if rows or verdicts or perceived:
            self._news_s = time.monotonic()
        lag_events = self._measured.lag if rows else 0  # who found nothing new is not behind
        self._backlog.show(taken=sum(self._measured.checkpoint.values()), lag_events=lag_events)
        return bool(rows or verdicts or perceived)

    def _taken(self, fleet: LiveFleet, row: Envelope[Observed]) -> Sequence[DrivePlace]:
        """Where one more measurement brought its drive; of one that begins with it, what was perceived already."""
        begins = fleet.described((row.identity.source, row.identity.boot_id)) is None
        places = fleet.take(row)
        return [*places, *self._perceived.begun(fleet)] if begins else places

    def _correct(self, places: Sequence[DrivePlace]) -> None:
        rows: list[Envelope[Event]] = []
        for place in places:
            name = (place.vehicle, place.boot_id)
            if place.stamp_ns <= self._said_ns.get(name, -1):
                continue
            self._said_ns[name] = place.stamp_ns
            boot_id, sequence = self._boots.get(name) or (_run_id(place), 0)
            self._boots[name] = boot_id, sequence + 1
            event = OdometryCorrected(
                vehicle=place.vehicle,
                boot_id=place.boot_id,
                map_version=self._version,
                T_map_odom=place.T_map_odom,
                covariance=place.covariance,
            )
            rows.append(Envelope(EventIdentity(SOURCE, boot_id, sequence), place.stamp_ns, event))
        self._say(ODOMETRY_STREAM, rows)

    def _tell(self) -> bool:
        """The landmarks that changed as the next version, once it is time; whether there were any."""
        now_s = time.monotonic()
        if self._fleet is None or now_s < self._told_s + self._settings.live.version_interval_s:
            return False
        self._told_s = now_s
        return self._tell_changed()

    def _tell_changed(self) -> bool:
        assert self._fleet is not None, "begun before"
        began_s = time.monotonic()
        changed = self._fleet.map.changed_landmarks(share=self._settings.live.moved_share)
        if changed:
            head = MapSolved(
                map_version=0,
                method=METHOD,
                settings_json=settings_json(self._settings),
                inputs=self._positions(),
                landmark_count=self._fleet.map.told_count,
                anchor_count=self._anchor_count,
                wall_s=time.monotonic() - began_s,
                base_version=self._version,
            )
            self._append_version(changed, head, stamp_ns=self._newest_ns)
        return bool(changed)

    def _positions(self) -> tuple[tuple[str, int], ...]:
        """How far each stream is taken in, by the version before or since."""
        followed = (self._measured, self._judged, self._corrected)
        at = {PERCEIVED_STREAM: self._perceived.number}
        for one in followed:
            at.update(one.checkpoint)
        return tuple(
            (stream, max(at.get(stream, number), self._version_inputs.get(stream, 0)))
            for stream, number in input_positions(self._log)
        )

    def _append_version(self, parts: Iterable[Mapped], head: MapSolved, *, stamp_ns: int) -> None:
        """The next version appended, few events at a time: until its head is there, nobody takes them for one."""
        version, sequence = self._version + 1, 0
        boot_id = boot_id_of(version, head.inputs, self._settings)
        events = chain(parts, (head,))
        while some := [replace(event, map_version=version) for event in _some(events)]:
            self._say(STREAM, envelopes(some, boot_id=boot_id, stamp_ns=stamp_ns, first_sequence=sequence))
            sequence += len(some)
        self._version, self._version_inputs = version, dict(head.inputs)
        self._instruments.map_version.set(version)

    def _say(self, stream: str, rows: Sequence[Envelope[Event]]) -> None:
        """Events appended, then published."""
        if not rows:
            return
        with self._instruments.fsync_seconds.time():
            self._log.append(stream, rows)
        if self._bus is not None:
            root, name, frame = self._root, self._map_name, self._frame
            self._bus.publish_all(
                [event_message(row, key=key_of(row, root=root, map_name=name, frame=frame)) for row in rows]
            )

    def _solve(self) -> None:
        """A whole solve taken in if it is there, or begun if it is called for."""
        if self._solver.busy:
            found = self._solver.result()
            if found is not None:
                self._take_whole(found)
            elif self.pose_count > SOLVING * self._settings.live.pose_limit:
                self._begin_again()
            return
        reason = self._reason_to_solve()
        if reason:
            logger.info("solving the whole map", extra={"reason": reason})
            self._solved_s, self._correction_s = time.monotonic(), None
            self._solver.begin()

    def _reason_to_solve(self) -> str:
        assert self._fleet is not None, "begun before"
        live, now_s, growing = self._settings.live, time.monotonic(), self._fleet.map
        corrected = self._correction_s is not None and now_s >= self._correction_s + live.correction_delay_s
        if corrected and input_positions(self._log) != self._tried_inputs:
            return "labels or excluded drives changed"
        if now_s >= self._solved_s + live.solve_interval_s:
            if growing.doubt:
                return growing.doubt
            if growing.pose_count > live.pose_limit:
                return f"the graph has {growing.pose_count} poses: {live.pose_limit} is the limit"
        quiet = self._ready and now_s >= self._news_s + live.settle_s
        if quiet and input_positions(self._log) not in (self._solved_inputs, self._tried_inputs):
            return f"no news for {live.settle_s:g} s"
        return ""

    def _begin_again(self) -> None:
        """As after a restart, once all is told: memory is bounded also where no whole solve comes."""
        while self._tell_changed():
            pass
        logger.warning("the graph begins anew from the newest version", extra={"map_version": self._version})
        self._fleet = None

    def _take_whole(self, found: WholeSolve) -> None:
        """The map as a whole solve has it, and from there on what came since."""
        assert self._fleet is not None, "begun before"
        self._tried_inputs = found.inputs
        self._instruments.solve_seconds.observe(time.monotonic() - self._solved_s)
        for line in found.left_out:
            logger.warning("%s", line)
        if found.head is None:
            logger.warning("the whole map cannot be solved: %s", found.refusal)
            self._correction_s = time.monotonic() + self._settings.live.solve_interval_s  # with more data perhaps
            if self.pose_count > self._settings.live.pose_limit:
                self._begin_again()
            return
        base: list[Mapped] = []
        self._append_version(_noted(found.parts, base), found.head, stamp_ns=found.stamp_ns)
        self._solved_inputs = found.inputs
        self._anchor_count = found.head.anchor_count
        self._excluded = excluded_drives(logged_corrections(self._log))
        self._fleet.begin_anew(
            [event for event in base if isinstance(event, LandmarkSolved)],
            [event for event in base if isinstance(event, TrajectorySolved)],
            excluded=self._excluded,
        )


def _noted(parts: Iterable[Mapped], base: list[Mapped]) -> Iterator[Mapped]:
    """The events of a version as they are, noted in `base` without what is not needed to go on from it."""
    for part in parts:
        base.append(needed_of(part))
        yield part


def _some(events: Iterator[Mapped]) -> Iterator[Mapped]:
    """The next events, few enough to be written at a time."""
    parts = 0
    for event in islice(events, TOGETHER):
        yield event
        parts += len(event.observations) if isinstance(event, LandmarkSolved) else 0
        parts += len(event.stamp_ns) if isinstance(event, TrajectorySolved) else 0
        if parts > TOGETHER_PARTS:
            return


def _run_id(place: DrivePlace) -> str:
    """The boot under which corrections of a drive are numbered from a stamp on."""
    text = f"{place.vehicle}/{place.boot_id}/{place.stamp_ns}"
    return blake2b(text.encode(), digest_size=8).hexdigest()

"""Filtering as a service: the vehicles' streams in the log followed, from wherever it left off."""

import logging
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self, cast

from trigpoint.bus.event_messages import event_message
from trigpoint.bus.ports import Bus
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope
from trigpoint.events.estimated import Estimated, FixJudged
from trigpoint.events.keys import DEFAULT_ROOT, KEY_VERSION, key_of
from trigpoint.events.observed import Observed
from trigpoint.geodesy.projection import MapFrame
from trigpoint.logs.checkpoints import write_checkpoint
from trigpoint.logs.following import StreamFollower
from trigpoint.logs.ports import RecallingLog
from trigpoint.logs.readings import is_vehicle_stream, pinned_frame, vehicle_streams
from trigpoint.observability.backlog import Backlog
from trigpoint.observability.metrics import Instruments
from trigpoint_filtering.app import KINDS, STREAM
from trigpoint_filtering.checkpoint import Progress, read_progress
from trigpoint_filtering.core.fleet_following import KEPT_BOOTS, DriveName, FleetFollower
from trigpoint_filtering.core.follower import REORDER_NS
from trigpoint_filtering.core.publication import output_boot_id
from trigpoint_filtering.settings import FilterSettings

LOOK_S = 0.5  # between two looks at the log when nobody tells of news
GATHER_S = 0.02  # after the first word of news: what comes together is appended together
BATCH = 1024  # events taken at a time
CHECKPOINT_S = 5.0  # between two checkpoints: so much is filtered again after a crash
CLOSE_S = 5.0  # for what is still in the log when it is told to stop

logger = logging.getLogger(__name__)


class LiveFiltering:
    """Takes every vehicle's events from the log, in its order; appends its estimates, then publishes them.

    A message on the bus only wakes it up, so that nothing is lost with one. After a restart it goes on from its
    `checkpoint` file, without one each drive is filtered from its beginning again; what was said is not said twice.
    Close it, or leave its `with`.
    """

    def __init__(
        self,
        log: RecallingLog,
        bus: Bus,
        settings: FilterSettings | None = None,
        *,
        root: str = DEFAULT_ROOT,
        checkpoint: Path | None = None,
        instruments: Instruments | None = None,
    ) -> None:
        self._log, self._bus, self._root = log, bus, root
        self._checkpoint, self._kept_s = checkpoint, time.monotonic()
        self._settings = settings or FilterSettings()
        self._instruments = instruments or Instruments("filtering")
        self._said = _said_before(log)
        self._streams = StreamFollower(log, is_vehicle_stream, kinds=KINDS)
        self._fleet: FleetFollower | None = None
        self._backlog = Backlog(self._instruments)
        self._closed = False
        self.ready = False
        self._news = bus.news(f"{root}/{KEY_VERSION}/veh/*/obs/**")

    def run(self, stop: threading.Event) -> None:
        """Works until told to stop. Raises AppendFailed when the log cannot be written: then it must stop."""
        while not stop.is_set():
            if not self.step(LOOK_S) and not self.ready:
                stop.wait(LOOK_S)

    def step(self, timeout_s: float) -> bool:
        """What the log has next taken, appended and published; without news, some waited for (then False if none)."""
        if self._take():
            return True
        self.ready = True
        if not self._news.wait(timeout_s):
            return False
        threading.Event().wait(min(GATHER_S, timeout_s))
        return True

    def _take(self) -> bool:
        """Whether there were events, and a frame to place them in."""
        fleet = self._fleet = self._fleet or self._begun()
        if fleet is None:
            return False
        logged = self._streams.take(BATCH)
        rows = [told for row in logged for told in fleet.take(cast(Envelope[Observed], row.envelope))]
        self._append(rows)
        self._backlog.show(taken=sum(self._streams.checkpoint.values()), lag_events=self._streams.lag)
        if logged and time.monotonic() >= self._kept_s + CHECKPOINT_S:
            self._keep(fleet)
        return bool(logged)

    def _keep(self, fleet: FleetFollower) -> None:
        """A checkpoint written, if there is a file for it; a disk that has no room for it has the log to itself."""
        self._kept_s = time.monotonic()
        if self._checkpoint is None:
            return
        taken = self._streams.checkpoint
        try:
            kept = Progress(frame=fleet.frame, settings=self._settings, taken=dict(taken), fleet=fleet)
            write_checkpoint(self._checkpoint, kept)
        except OSError as error:
            logger.warning("%s: no checkpoint written: %s", self._checkpoint, error)

    def _begun(self) -> FleetFollower | None:
        """The fleet from the checkpoint, or from the beginning of the log; None before a frame is pinned: the log
        keeps the events."""
        frame = pinned_frame(self._log)
        kept = None
        if frame is not None and self._checkpoint is not None:
            kept = read_progress(self._checkpoint, frame=frame, settings=self._settings)
        if kept is not None:
            self._streams = StreamFollower(self._log, is_vehicle_stream, checkpoint=kept.taken, kinds=KINDS)
            return kept.fleet
        return None if frame is None else FleetFollower(frame, self._settings, ended=tuple(self._whole_drives(frame)))

    def _whole_drives(self, frame: MapFrame) -> Iterator[DriveName]:
        """Drives a later one followed, of which everything was said: estimates reach what only an end gives out."""
        for stream in vehicle_streams(self._log):
            for boot in self._log.boots(stream)[:-KEPT_BOOTS]:
                said = self._said.get(output_boot_id(boot.source, boot.boot_id, frame, self._settings))
                if said is not None and said.newest_ns > boot.end_ns - REORDER_NS:
                    yield boot.source, boot.boot_id

    def _append(self, told: Sequence[Envelope[Estimated]]) -> None:
        """What was not yet said of it in the log, then published."""
        rows = [row for row in told if row.identity.sequence >= self._said.get(row.identity.boot_id, NOTHING).count]
        if not rows:
            return
        began_s = time.perf_counter()
        self._log.append(STREAM, cast(list[Envelope[Event]], rows))
        self._instruments.fsync_seconds.observe(time.perf_counter() - began_s)
        for row in rows:
            self._bus.publish(event_message(cast(Envelope[Event], row), key=key_of(row, root=self._root)))
            self._count(row.event)

    def _count(self, event: Estimated) -> None:
        if isinstance(event, FixJudged) and event.accepted:
            self._instruments.accepted.labels(event.vehicle).inc()
        elif isinstance(event, FixJudged):
            self._instruments.rejected.labels(event.vehicle, event.reason).inc()

    def close(self) -> None:
        """What the log has is taken, for at most `CLOSE_S`, and if that was all, what still waited for later events
        is given out; again: no effect."""
        if self._closed:
            return
        self._closed, self.ready = True, False
        self._news.close()
        until_s = time.monotonic() + CLOSE_S
        while self._take():
            if time.monotonic() > until_s:
                logger.warning("stopped before the end of the log", extra={"lag_events": self._streams.lag})
                return
        if self._fleet is not None:
            self._keep(self._fleet)
            self._append(list(self._fleet.finish()))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self._news.close()


@dataclass(frozen=True, slots=True)
class _SaidBefore:
    """How many of a drive's estimates are in the log, and the stamp of the newest."""

    count: int
    newest_ns: int


NOTHING = _SaidBefore(0, -1)


def _said_before(log: RecallingLog) -> dict[str, _SaidBefore]:
    """What filtering has appended, by its own boots; only headers are read for it."""
    said: dict[str, _SaidBefore] = {}
    for run in log.read_headers(STREAM):
        before = said.get(run.boot_id, NOTHING)
        count = max(before.count, int(run.sequences.max()) + 1)
        said[run.boot_id] = _SaidBefore(count, max(before.newest_ns, int(run.stamps_ns.max())))
    return said

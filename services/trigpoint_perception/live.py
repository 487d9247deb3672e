"""Perception as a service: the sweeps in the log followed, from wherever it left off."""

import logging
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Self, cast

from trigpoint.bus.event_messages import event_message
from trigpoint.bus.ports import Bus
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope
from trigpoint.events.keys import DEFAULT_ROOT, KEY_VERSION, key_of
from trigpoint.events.observed import Observed
from trigpoint.events.perceived import LandmarksPerceived, SweepPerceived
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.checkpoints import write_checkpoint
from trigpoint.logs.following import StreamFollower
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import is_vehicle_stream
from trigpoint.observability.backlog import Backlog
from trigpoint.observability.metrics import Instruments
from trigpoint_perception.app import KINDS, STREAM, SWEEP_KINDS, sweep_counts
from trigpoint_perception.checkpoint import Progress, read_progress
from trigpoint_perception.core.fleet_following import KEPT_BOOTS, DriveName, FleetFollower, ToldOf
from trigpoint_perception.core.publication import Spoken, output_boot_id, reason_of
from trigpoint_perception.settings import PerceptionSettings

LOOK_S = 0.5  # between two looks at the log when nobody tells of news
BATCH = 16  # events decoded at a time: a sweep takes a megabyte, the largest twenty
QUIET_S = 5.0  # after a drive's last event, when all is taken: what waits for later sweeps is then given out
ENDED = "drive had ended"  # a sweep that came so late: `trigpoint perceive` takes it
CHECKPOINT_S = 10.0  # between two checkpoints: so much is perceived again after a crash

logger = logging.getLogger(__name__)


class LivePerception:
    """Takes every vehicle's sweeps from the log, in its order; appends what was found in them, then publishes it.

    A message on the bus only wakes it up: who cannot keep up lags behind the log and holds no message. After a restart
    it goes on from its `checkpoint` file, without one each drive is perceived from its beginning again; what was said
    is not said twice. Close it, or leave its `with`.
    """

    def __init__(
        self,
        log: EventLog,
        bus: Bus,
        *,
        root: str = DEFAULT_ROOT,
        checkpoint: Path | None = None,
        instruments: Instruments | None = None,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._log, self._bus, self._root = log, bus, root
        self._settings = PerceptionSettings()  # those of `trigpoint perceive`: both number their events alike
        self._instruments = instruments or Instruments("perception")
        self._backlog = Backlog(self._instruments)
        self._now_s, self._checkpoint = now_s, checkpoint
        self._began_s = self._kept_s = now_s()
        self._heard_s: dict[DriveName, float] = {}
        self._closed = False
        self.ready = False
        self._news = bus.news(f"{root}/{KEY_VERSION}/veh/*/obs/**")
        self._begin()

    def _begin(self) -> None:
        """From the checkpoint, or from the beginning of the log."""
        kept = None
        if self._checkpoint is not None:
            kept = read_progress(self._checkpoint, self._log, stream=STREAM, settings=self._settings)
        self._spoken = Spoken(kept.said if kept else {})
        for logged in self._log.read(STREAM, first_number=kept.appended if kept else 0, kinds=SWEEP_KINDS):
            self._spoken.add(cast(Envelope[SweepPerceived], logged.envelope))
        self._fleet = kept.fleet if kept else FleetFollower(self._settings, ended=tuple(self._whole_drives()))
        taken = kept.taken if kept else {}
        self._streams = StreamFollower(self._log, is_vehicle_stream, checkpoint=taken, kinds=KINDS)
        logger.info("going on", extra={"from_checkpoint": kept is not None})

    def _whole_drives(self) -> Iterator[DriveName]:
        """Drives a later one followed, of whose sweeps all was said."""
        for _, counts in sweep_counts(self._log):
            for name in list(counts)[:-KEPT_BOOTS]:
                if self._spoken.sweeps(self._boot_id(name)) >= counts[name]:
                    self._spoken.forget(self._boot_id(name))
                    yield name

    def _boot_id(self, name: DriveName) -> str:
        return output_boot_id(*name, self._settings)

    def run(self, stop: threading.Event) -> None:
        """Works until told to stop. Raises AppendFailed when the log cannot be written, and LogDamaged."""
        while not stop.is_set():
            self.step(LOOK_S)

    def step(self, timeout_s: float) -> bool:
        """What the log has next taken, appended and published; without news, some waited for (then False if none)."""
        if self._take():
            return True
        self.ready = True
        return self._give_out_quiet() or self._news.wait(timeout_s)

    def _take(self) -> bool:
        """Whether there were events."""
        logged = self._streams.take(BATCH)
        rows = [cast(Envelope[Observed], row.envelope) for row in logged]
        for row in rows:
            name = (row.identity.source, row.identity.boot_id)
            self._heard_s[name] = self._now_s()
            if isinstance(row.event, PointsScanned) and self._fleet.has_ended(name):
                self._instruments.rejected.labels(row.identity.source, ENDED).inc()
        self._append(told for row in rows for told in self._timed(partial(self._fleet.take, row)))
        self._backlog.show(taken=sum(self._streams.checkpoint.values()), lag_events=self._streams.lag)
        if logged and self._now_s() >= self._kept_s + CHECKPOINT_S:
            self._keep()
        return bool(logged)

    def _timed(self, work: Callable[[], Iterable[ToldOf]]) -> list[ToldOf]:
        """What a piece of work makes certain; the time it takes is that of the sweeps it perceives."""
        began_s, before = time.perf_counter(), self._fleet.perceived
        told = list(work())
        count = self._fleet.perceived - before
        for _ in range(count):
            self._instruments.sweep_seconds.observe((time.perf_counter() - began_s) / count)
        return told

    def _give_out_quiet(self) -> bool:
        """Whether anything waited of drives that have been quiet for long; it is appended."""
        since_s = self._now_s() - QUIET_S
        quiet = [name for name in self._fleet.waiting() if self._heard_s.get(name, self._began_s) <= since_s]
        self._append(self._timed(lambda: [(name, self._fleet.finished(name)) for name in quiet]))
        self._heard_s = {name: heard_s for name, heard_s in self._heard_s.items() if heard_s > since_s}
        return bool(quiet)

    def _append(self, told: Iterable[ToldOf]) -> None:
        """What was not yet said of it in the log, then published."""
        rows = [row for name, some in told for row in self._spoken.fresh(some, boot_id=self._boot_id(name))]
        if not rows:
            return
        with self._instruments.fsync_seconds.time():
            self._log.append(STREAM, cast(list[Envelope[Event]], rows))
        for row in rows:
            self._bus.publish(event_message(cast(Envelope[Event], row), key=key_of(row, root=self._root)))
            self._count(row.event)

    def _count(self, event: SweepPerceived) -> None:
        if isinstance(event, LandmarksPerceived) and event.refusal:
            self._instruments.rejected.labels(event.vehicle, reason_of(event.refusal)).inc()
        elif isinstance(event, LandmarksPerceived):
            self._instruments.accepted.labels(event.vehicle).inc()

    def _keep(self) -> None:
        """A checkpoint written, if there is a file for it; a disk that has no room for it has the log to itself."""
        self._kept_s = self._now_s()
        if self._checkpoint is None:
            return
        progress = Progress(
            settings=self._settings,
            taken=self._streams.checkpoint,
            appended=self._log.next_number(STREAM),
            said=self._spoken.counts,
            fleet=self._fleet,
        )
        try:
            write_checkpoint(self._checkpoint, progress)
        except OSError as error:
            logger.warning("%s: no checkpoint written: %s", self._checkpoint, error)

    def close(self) -> None:
        """A checkpoint written, nothing more heard; what waits for later sweeps is given out by whoever goes on. Again:
        no effect."""
        if self._closed:
            return
        self._closed, self.ready = True, False
        self._news.close()
        self._keep()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self._news.close()

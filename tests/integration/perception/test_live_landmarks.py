"""A vehicle sends sweeps and no detection: perception and optimisation, over Zenoh, make landmarks of them, and
perception is stopped and started on the way."""

import threading
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from bus_sessions.pairs import free_endpoint
from command_runs.processes import wait_until
from scanned_worlds.casting import STREET
from scanned_worlds.drives import fixed_drive
from solved_worlds.examples import FRAME
from solved_worlds.logged import all_accepted
from trigpoint.bus.event_messages import event_message
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.keys import key_of
from trigpoint.events.mapped import LandmarkSolved, MapSolved
from trigpoint.events.observed import MapFramePinned
from trigpoint.events.perceived import LandmarksPerceived
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.mcap_log import McapLog
from trigpoint.observability.running import Service
from trigpoint_optimisation.app import STREAM as MAP_STREAM
from trigpoint_optimisation.live import LiveOptimisation
from trigpoint_optimisation.settings import LiveSettings, SolveSettings
from trigpoint_optimisation.whole_solve import SolverInPlace
from trigpoint_perception.app import STREAM
from trigpoint_perception.live import LivePerception

SWEEPS = 60  # on a bend: a shorter one does not tell a heading
WAITING = 5  # sweeps of a drive that goes on
NEVER_S = 1e9
EAGER = SolveSettings(live=LiveSettings(version_interval_s=0.2, settle_s=NEVER_S, solve_interval_s=NEVER_S))


@cache
def rows() -> Sequence[Envelope[Event]]:
    return tuple(fixed_drive("van", SWEEPS, FRAME))


@contextmanager
def at_work(service: Service) -> Iterator[None]:
    """A service in a thread of its own, until the end."""
    stop = threading.Event()
    thread = threading.Thread(target=service.run, args=(stop,))
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
        service.close()


@dataclass(frozen=True, slots=True)
class Site:
    """A log on disk and a bus; each service opens both for itself, as a process does."""

    folder: Path
    endpoint: str

    @contextmanager
    def perceiving(self) -> Iterator[None]:
        with self._opened() as (log, bus), at_work(LivePerception(log, bus, checkpoint=self.folder / "perception")):
            yield

    @contextmanager
    def optimising(self) -> Iterator[None]:
        with self._opened() as (log, bus):
            service = LiveOptimisation(log, SolverInPlace(log, EAGER), bus, settings=EAGER)
            with at_work(service):
                yield

    @contextmanager
    def _opened(self) -> Iterator[tuple[McapLog, ZenohBus]]:
        bus = ZenohBus(ZenohSettings(connect=(self.endpoint,)))
        with closing(McapLog(self.folder / "log")) as log, bus:
            yield log, bus


@dataclass(frozen=True, slots=True)
class Ingest:
    """Appends what a vehicle measured, then tells of it."""

    log: McapLog
    bus: ZenohBus

    def take(self, some: Sequence[Envelope[Event]]) -> None:
        self.log.append("veh-van", list(some))
        for row in some:
            self.bus.publish(event_message(row, key=key_of(row)))

    def told(self) -> list[int]:
        """The sweeps perception has told of."""
        rows = (row.envelope.event for row in self.log.read(STREAM, kinds=(LandmarksPerceived,)))
        return [event.sweep_sequence for event in rows if isinstance(event, LandmarksPerceived)]

    def landmarks(self) -> dict[str, LandmarkSolved]:
        """The newest state of each landmark of the map."""
        events = [row.envelope.event for row in self.log.read(MAP_STREAM, kinds=(LandmarkSolved, MapSolved))]
        return {event.landmark: event for event in events if isinstance(event, LandmarkSolved)}


def begun(log: McapLog) -> None:
    """The frame, and the filter's word on every fix there is going to be."""
    origin = {"origin_easting_m": FRAME.origin_easting_m, "origin_northing_m": FRAME.origin_northing_m}
    pinned = MapFramePinned(crs=FRAME.crs, **origin, declared_by="test")
    log.append("map", [Envelope(EventIdentity("ingest", "frame", 0), 0, pinned)])
    verdicts = [Envelope(EventIdentity("filtering", "van", n), 0, one) for n, one in enumerate(all_accepted(rows()))]
    log.append("filtering", [*verdicts])


@pytest.fixture
def site(tmp_path: Path) -> Iterator[tuple[Site, Ingest]]:
    endpoint = free_endpoint()
    with closing(McapLog(tmp_path / "log")) as log, ZenohBus(ZenohSettings(listen=(endpoint,))) as bus:
        begun(log)
        yield Site(tmp_path, endpoint), Ingest(log, bus)


def sequences(some: Sequence[Envelope[Event]]) -> list[int]:
    return [row.identity.sequence for row in some if isinstance(row.event, PointsScanned)]


def poles_off_m(landmarks: dict[str, LandmarkSolved]) -> list[float]:
    """How far each pole of the map is from the nearest there is."""
    found = [one.position_m for one in landmarks.values() if one.kind == "pole"]
    return [float(np.hypot(*(STREET.pole_m - at_m).T).min()) for at_m in found]


def test_landmarks_come_out_of_sweeps_and_a_restart_leaves_none_out(site: tuple[Site, Ingest]) -> None:
    fleet, ingest = site
    half = len(rows()) // 2
    first, second = sequences(rows()[:half]), sequences(rows())
    with fleet.optimising():
        with fleet.perceiving():
            ingest.take(rows()[:half])
            wait_until(lambda: len(ingest.told()) >= len(first) - WAITING, "the first half to be perceived")
        ingest.take(rows()[half:])
        with fleet.perceiving():
            wait_until(lambda: len(ingest.told()) >= len(second) - WAITING, "the second half to be perceived")
            wait_until(lambda: len(ingest.landmarks()) >= 5, "landmarks in the map")
    assert ingest.told() == second[: len(ingest.told())]
    assert max(poles_off_m(ingest.landmarks())) < 2.0

"""The projection as a service: it follows, waits for its database, and shows how far behind it is."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from landmark_maps.examples import MAP_STREAM, append_mapped, pin_frame, solved_landmark, solved_map
from trigpoint.bus.event_messages import event_message
from trigpoint.bus.memory_bus import MemoryBus
from trigpoint.errors import DatabaseUnavailable, ServiceError
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.landmarks.memory_store import MemoryStore
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.observability.metrics import Instruments
from trigpoint_landmarks.live import LandmarkProjection
from trigpoint_landmarks.settings import LandmarkSettings

PROMPT = LandmarkSettings(look_s=0.01, retry_s=0.01, retry_limit_s=0.02)
LIMIT_S = 10.0


class AwayAtFirst:
    """Opens a store that is away so many times."""

    def __init__(self, times: int) -> None:
        self.store, self.left = MemoryStore(), times
        self.opened = threading.Event()

    def __call__(self) -> LandmarkStore:
        if self.left:
            self.left -= 1
            raise DatabaseUnavailable("no answer")
        self.opened.set()
        return self.store


class LostOnce(MemoryStore):
    """A store whose server goes away in the first transaction, after it has committed it or before."""

    def __init__(self, *, committed: bool) -> None:
        super().__init__()
        self._committed, self._lost = committed, False

    def apply_all(self, changes, checkpoint) -> None:  # type: ignore[no-untyped-def]
        if self._lost or self._committed:
            super().apply_all(changes, checkpoint)
        if not self._lost:
            self._lost = True
            raise DatabaseUnavailable("the server went away")


@pytest.fixture
def log() -> MemoryLog:
    """A log of one version."""
    log = MemoryLog()
    pin_frame(log)
    append_mapped(log, solved_map(1, [solved_landmark("L1", 0.0, 0.0)]))
    return log


@contextmanager
def running(service: LandmarkProjection) -> Iterator[None]:
    """The service at work in a thread; what it raises is raised here."""
    stop, errors = threading.Event(), list[BaseException]()

    def work() -> None:
        try:
            service.run(stop)
        except ServiceError as error:
            errors.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(LIMIT_S)
        service.close()
    assert not errors


def until(holds: Callable[[], bool]) -> bool:
    """Whether it came to hold in time."""
    pause = threading.Event()
    return any(holds() or pause.wait(0.01) for _ in range(round(LIMIT_S / 0.01)))


def numbers(instruments: Instruments, name: str) -> float:
    found = instruments.registry.get_sample_value(f"trigpoint_{name}")
    assert found is not None
    return found


def test_it_is_ready_once_the_database_has_everything(log: MemoryLog) -> None:
    store = MemoryStore()
    service = LandmarkProjection(log, lambda: store, settings=PROMPT)
    assert not service.ready
    with running(service):
        assert until(lambda: service.ready)
        assert [version.map_version for version in store.map_versions()] == [1]


def test_it_takes_in_what_comes_later(log: MemoryLog) -> None:
    store = MemoryStore()
    service = LandmarkProjection(log, lambda: store, settings=PROMPT)
    with running(service):
        assert until(lambda: service.ready)
        append_mapped(log, solved_map(2, [solved_landmark("L1", 1.0, 0.0, map_version=2)]))
        assert until(lambda: len(store.map_versions()) == 2)


def test_a_message_of_a_version_wakes_it_up(log: MemoryLog) -> None:
    store, bus = MemoryStore(), MemoryBus()
    slow = LandmarkSettings(look_s=3600.0)
    service = LandmarkProjection(log, lambda: store, bus=bus, settings=slow)
    with running(service):
        assert until(lambda: service.ready)
        events = solved_map(2, [solved_landmark("L1", 1.0, 0.0, map_version=2)])
        append_mapped(log, events)
        head = Envelope(EventIdentity("trigpoint_optimisation", "boot-1", 99), 0, events[-1])
        bus.publish(event_message(head, key="trigpoint/v1/map/map/version"))
        assert until(lambda: len(store.map_versions()) == 2)
        bus.close()


def test_it_waits_for_a_database_that_is_away(log: MemoryLog) -> None:
    away = AwayAtFirst(3)
    service = LandmarkProjection(log, away, settings=PROMPT)
    with running(service):
        assert until(lambda: service.ready)
    assert (away.left, len(away.store.map_versions())) == (0, 1)


@pytest.mark.parametrize("committed", [True, False])
def test_a_server_lost_in_a_transaction_leaves_every_version_there_once(log: MemoryLog, committed: bool) -> None:
    append_mapped(log, solved_map(2, [solved_landmark("L1", 1.0, 0.0, map_version=2)]))
    store = LostOnce(committed=committed)
    service = LandmarkProjection(log, lambda: store, settings=PROMPT)
    with running(service):
        assert until(lambda: service.ready)
    assert [version.map_version for version in store.map_versions()] == [1, 2]


def test_it_says_how_far_behind_it_is(log: MemoryLog) -> None:
    instruments = Instruments("landmarks")
    away = AwayAtFirst(1_000_000)
    service = LandmarkProjection(log, away, settings=PROMPT, instruments=instruments)
    with running(service):
        assert until(lambda: numbers(instruments, "projection_lag_events") == log.next_number(MAP_STREAM))
        assert until(lambda: numbers(instruments, "projection_lag_seconds") > 0.0)
        away.left = 0
        assert until(lambda: service.ready)
        assert numbers(instruments, "projection_lag_events") == 0
        assert numbers(instruments, "projection_lag_seconds") == 0.0
        assert numbers(instruments, "map_version") == 1


def test_a_version_that_is_refused_is_counted(log: MemoryLog) -> None:
    instruments = Instruments("landmarks")
    append_mapped(log, solved_map(2, [solved_landmark("L1", 1.0, 0.0, map_version=2)])[-1:])
    service = LandmarkProjection(log, MemoryStore, settings=PROMPT, instruments=instruments)
    with running(service):
        assert until(lambda: service.ready)
    labels = {"vehicle": "", "reason": "map version"}
    assert instruments.registry.get_sample_value("trigpoint_rejected_total", labels) == 1.0

"""The answering service at work in this process, beside a store that tells of its changes."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from bus_sessions.pairs import free_endpoint
from trigpoint.bus.ports import Bus
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.events.keys import ASK_PATTERN, map_key
from trigpoint.landmarks.asked import AnsweredMap, CoverageAnswer, CoverageQuestion
from trigpoint.landmarks.memory_store import MemoryStore
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.observability.metrics import Instruments
from trigpoint_landmarks.answering.service import MapAnswers
from trigpoint_landmarks.answering.stored import Coverage
from trigpoint_landmarks.change_feed import ChangeFeed, FeedingStore
from trigpoint_landmarks.settings import AnswerSettings

ROOT, MAP = "t", "main"
SOON_S = 20.0  # everything here takes milliseconds; the rest is a slow machine's share
KEY = f"{ROOT}/v1/map/{MAP}/ask/landmarks"


class NothingObserved:
    """No coverage at all."""

    def answer(self, question: CoverageQuestion) -> CoverageAnswer:
        return CoverageAnswer(map=AnsweredMap(), tiles=())


@dataclass(frozen=True, slots=True)
class AnsweredStore:
    """What a test has: the store to write to, which tells of it; the same without a word; and the service's counts."""

    store: LandmarkStore
    silent: LandmarkStore
    instruments: Instruments


@contextmanager
def zenoh_pair() -> Iterator[tuple[ZenohBus, ZenohBus]]:
    """Two sessions over loopback TCP, scouting off."""
    endpoint = free_endpoint()
    with ZenohBus(ZenohSettings(listen=(endpoint,))) as one, ZenohBus(ZenohSettings(connect=(endpoint,))) as other:
        yield one, other


@contextmanager
def answered(
    store: MemoryStore,
    bus: Bus,
    *,
    coverage: Coverage | None = None,
    settings: AnswerSettings | None = None,
    tells: bool = True,
    names: tuple[str, str] = (ROOT, MAP),
) -> Iterator[AnsweredStore]:
    """The service answering from a store; what is applied through it is told of, if it `tells`."""
    instruments, stop = Instruments("answers"), threading.Event()
    service = MapAnswers(
        bus, lambda: store, coverage or NothingObserved(), names=names, settings=settings, instruments=instruments
    )
    thread = threading.Thread(target=service.run, args=(stop,), daemon=True)
    key = map_key(ASK_PATTERN, root=names[0], map_name=names[1], chunks={"question": "landmarks"})
    with ChangeFeed(bus, root=names[0], map_name=names[1]) as feed:
        thread.start()
        until(lambda: service.ready and bus.await_queryable(key, SOON_S))
        try:
            yield AnsweredStore(FeedingStore(store, feed) if tells else store, store, instruments)
        finally:
            stop.set()
            thread.join()
            service.close()


def until(holds: Callable[[], bool]) -> None:
    """Returns once it holds. Raises TimeoutError."""
    deadline_s, pause = time.monotonic() + SOON_S, threading.Event()
    while not holds():
        if time.monotonic() > deadline_s:
            raise TimeoutError(f"not so within {SOON_S:g} s")
        pause.wait(0.002)

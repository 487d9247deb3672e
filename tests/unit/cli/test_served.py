"""One service at work in a thread of its own."""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from trigpoint.errors import AppendFailed
from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_cli.served import ServedService

SOON_S = 30.0


class Work:
    """A service that catches up when it is told to, and ends when it is let go."""

    def __init__(self, *, error: Exception | None = None, stubborn: bool = False) -> None:
        self.ready = False
        self.error, self.stubborn = error, stubborn
        self.runs, self.let_go = threading.Event(), threading.Event()
        self.closed = False

    def run(self, stop: threading.Event) -> None:
        self.runs.set()
        if self.error is not None:
            raise self.error
        (self.let_go if self.stubborn else stop).wait(SOON_S)

    def close(self) -> None:
        self.closed = True


def served(work: Work, now_s: Callable[[], float] = time.monotonic) -> ServedService:
    @contextmanager
    def opened() -> Iterator[Service]:
        yield work

    service = ServedService(opened, Instruments("work"), silence_limit_s=60.0, now_s=now_s)
    service.start()
    assert work.runs.wait(SOON_S)
    return service


def test_a_service_is_alive_while_it_works_and_ready_once_it_says_so() -> None:
    work = Work()
    service = served(work)
    assert service.alive()[0]
    assert not service.ready()[0]
    work.ready = True
    assert service.ready()[0]
    assert service.stop(SOON_S)


def test_a_service_that_is_told_to_stop_is_closed_and_ready_no_more() -> None:
    work = Work()
    work.ready = True
    service = served(work)
    assert service.stop(SOON_S)
    assert work.closed
    assert not service.ready()[0]
    assert (service.stage, service.error) == ("ended", None)


def test_a_service_that_does_not_finish_in_time_says_so() -> None:
    work = Work(stubborn=True)
    service = served(work)
    assert not service.stop(0.01)
    assert service.stage == "stopping"
    work.let_go.set()
    assert service.stop(SOON_S)


def test_a_service_that_cannot_go_on_is_not_alive_and_its_error_is_told_without_passwords() -> None:
    error = AppendFailed("postgresql://me:geheim@host: no space left")
    service = served(Work(error=error))
    service.join(SOON_S)
    alive, told = service.alive()
    assert (alive, told["stage"], told["error"]) == (False, "failed", "postgresql://me:***@host: no space left")
    assert service.error is error


class Clock:
    """A clock that is put forward by hand."""

    def __init__(self) -> None:
        self.time_s = 0.0

    def __call__(self) -> float:
        return self.time_s


def test_a_service_whose_loop_does_not_come_round_is_not_alive_and_that_is_said_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    work, clock = Work(stubborn=True), Clock()
    service = served(work, clock)
    clock.time_s = 61.0
    service.look()
    service.look()
    alive, told = service.alive()
    assert (alive, told["error"]) == (False, "its loop last came round 61 s ago, limit 60 s")
    assert [record.levelno for record in caplog.records] == [logging.ERROR]
    work.let_go.set()
    assert service.stop(SOON_S)


def test_a_service_that_waits_for_news_is_alive_however_long() -> None:
    clock = Clock()
    service = served(Work(), clock)
    clock.time_s = SOON_S + 59.0  # it may wait for SOON_S, and be silent for 60 s after that
    assert service.alive()[0]
    assert service.stop(SOON_S)

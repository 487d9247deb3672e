"""What the router logs of refusals: at once, and never so much that it harms."""

import logging

import pytest

from trigpoint.bus.refusals import Refusal, Remark
from trigpoint.observability.metrics import Instruments
from trigpoint_cli.serving.router import KINDS_LIMIT, PERIOD_S, RefusalLog


class Clock:
    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def refusal(key: str = "k", *, who: str = "veh-a") -> Refusal:
    return Refusal(who, "Put", key)


def said(caplog: pytest.LogCaptureFixture) -> list[tuple[str, str, int]]:
    rows = [vars(record) for record in caplog.records if record.message == "refused"]
    return [(row["who"], row["key"], row["unsaid"]) for row in rows]


def test_the_same_refusal_is_counted_each_time_and_logged_once_a_period(caplog: pytest.LogCaptureFixture) -> None:
    instruments, clock = Instruments("router"), Clock()
    log = RefusalLog(instruments, now_s=clock)
    for now_s in (0.0, 1.0, 2.0, PERIOD_S):
        clock.now_s = now_s
        log.hear(refusal())
    assert said(caplog) == [("veh-a", "k", 0), ("veh-a", "k", 2)]
    assert b"trigpoint_refused_access_total 4.0" in instruments.exposition()


def test_a_sender_that_varies_its_keys_fills_no_disk_and_hides_nobody(caplog: pytest.LogCaptureFixture) -> None:
    log = RefusalLog(Instruments("router"), now_s=Clock())
    for index in range(10_000):
        log.hear(refusal(f"k{index}"))
    log.hear(refusal(who="veh-b"))
    assert len(said(caplog)) == KINDS_LIMIT + 1
    assert said(caplog)[-1] == ("veh-b", "k", 0)


def test_a_remark_of_zenohs_keeps_its_level(caplog: pytest.LogCaptureFixture) -> None:
    RefusalLog(Instruments("router")).hear(Remark("ERROR", "link broken"))
    assert [(record.levelno, record.message) for record in caplog.records] == [(logging.ERROR, "zenoh: link broken")]

"""When a publisher begins anew on its bus."""

import pytest

from trigpoint.bus.memory_bus import MemoryBus
from trigpoint.bus.ports import Bus
from trigpoint.bus.zenoh_bus import ZenohSettings
from trigpoint_vehicle.link import Link


class Clock:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


def opened_after(link: Link, clock: Clock, wait_s: float) -> Bus | None:
    clock.now_s += wait_s
    return link.opened()


def test_a_lent_bus_is_used_again_after_pauses_that_grow(clock: Clock) -> None:
    with MemoryBus() as bus:
        link = Link(bus, reopen_after_s=2.0, now_s=clock)
        assert link.opened() is bus
        assert opened_after(link, clock, 1.9) is None
        assert opened_after(link, clock, 0.1) is bus
        assert opened_after(link, clock, 3.9) is None
        assert opened_after(link, clock, 0.1) is bus
        assert link.sessions == 3


def test_after_work_done_the_pause_is_short_again(clock: Clock) -> None:
    with MemoryBus() as bus:
        link = Link(bus, reopen_after_s=2.0, now_s=clock)
        link.opened()
        opened_after(link, clock, 2.0)
        link.worked()
        opened_after(link, clock, 4.0)
        link.worked()
        assert opened_after(link, clock, 4.0) is bus


def test_a_lent_bus_is_never_worn_and_stays_open(clock: Clock) -> None:
    with MemoryBus() as bus:
        link = Link(bus, reopen_after_s=2.0, now_s=clock)
        link.opened()
        clock.now_s += 1000.0
        assert not link.is_worn(silent_s=1000.0)
        link.close()
        assert not bus.has_listener("somewhere")


def test_a_session_of_its_own_is_worn_after_a_silence(clock: Clock) -> None:
    link = Link(ZenohSettings(), reopen_after_s=2.0, now_s=clock)
    assert link.opened() is not None
    clock.now_s += 3.0
    assert not link.is_worn(silent_s=1.0)
    assert link.is_worn(silent_s=3.0)
    link.close()


def test_a_session_that_cannot_be_opened_is_tried_again_after_a_second_then_two(clock: Clock) -> None:
    link = Link(ZenohSettings(mode="client", connect=("tcp/127.0.0.1:9",)), reopen_after_s=60.0, now_s=clock)
    assert link.opened() is None
    assert not link.is_worn(silent_s=0.0)
    assert link.sessions == 0
    assert opened_after(link, clock, 1.0) is None
    assert opened_after(link, clock, 1.0) is None
    link.close()

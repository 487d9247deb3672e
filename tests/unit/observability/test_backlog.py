"""How far behind a service says it is."""

import pytest

from trigpoint.observability.backlog import MARKS_LIMIT, Backlog
from trigpoint.observability.metrics import Instruments


class Watched:
    """A backlog, a clock, and what is shown."""

    def __init__(self) -> None:
        self.time_s = 0.0
        self.instruments = Instruments("watched")
        self._backlog = Backlog(self.instruments, now_s=lambda: self.time_s)

    def at(self, time_s: float, *, taken: int, lag_events: int) -> tuple[float, float]:
        """The events and the seconds shown."""
        self.time_s = time_s
        self._backlog.show(taken=taken, lag_events=lag_events)
        names = ("trigpoint_projection_lag_events", "trigpoint_projection_lag_seconds")
        events, seconds = (self.instruments.registry.get_sample_value(name) or 0.0 for name in names)
        return events, seconds


def test_who_has_everything_is_not_behind() -> None:
    assert Watched().at(5.0, taken=10, lag_events=0) == (0.0, 0.0)


def test_who_takes_nothing_falls_behind_second_by_second() -> None:
    watched = Watched()
    assert watched.at(1.0, taken=10, lag_events=3) == (3.0, 0.0)
    assert watched.at(4.0, taken=10, lag_events=7) == (7.0, 3.0)


def test_the_age_is_that_of_the_oldest_event_not_taken() -> None:
    watched = Watched()
    watched.at(1.0, taken=10, lag_events=3)
    watched.at(4.0, taken=10, lag_events=7)
    assert watched.at(6.0, taken=13, lag_events=4) == (4.0, 2.0)


def test_who_is_always_a_few_events_behind_is_not_ever_later() -> None:
    watched = Watched()
    shown = [watched.at(float(second), taken=10 * second, lag_events=5) for second in range(100)]
    assert max(shown) == (5.0, 0.0)


def test_what_was_taken_in_again_from_an_older_checkpoint_counts_from_now() -> None:
    watched = Watched()
    watched.at(1.0, taken=10, lag_events=0)
    assert watched.at(9.0, taken=4, lag_events=6) == (6.0, 0.0)


def test_moments_are_remembered_in_bounded_memory_and_the_age_stays_right() -> None:
    watched, count = Watched(), 5 * MARKS_LIMIT
    shown = [watched.at(float(second), taken=0, lag_events=1 + second) for second in range(count)]
    assert shown[-1] == (count, count - 1.0)
    half_s = watched.at(float(count), taken=count // 2, lag_events=count // 2)[1]
    assert half_s == pytest.approx(count / 2, rel=0.02)  # moments further apart than this were not kept

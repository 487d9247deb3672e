"""When to send again, and when a recorded message is due."""

from functools import reduce

import pytest

from trigpoint_vehicle.core.patience import after_progress, after_sending, after_silence, patience
from trigpoint_vehicle.core.tempo import Tempo, after_stamp

BEGUN = after_sending(patience(first_s=1.0, longest_s=5.0), now_s=10.0)
S = 1_000_000_000


def test_nothing_is_waited_for_before_something_was_sent() -> None:
    assert not patience(first_s=1.0, longest_s=5.0).is_over(1e9)


def test_sending_more_does_not_prolong_the_wait() -> None:
    assert after_sending(BEGUN, now_s=10.9).is_over(11.0)


def test_each_wait_in_vain_is_twice_as_long_up_to_the_longest() -> None:
    waits = [BEGUN.wait_s]
    waiting = BEGUN
    for now_s in (11.0, 13.0, 17.0, 22.0):
        waiting = after_silence(waiting, now_s=now_s)
        waits.append(waiting.wait_s)
    assert waits == [1.0, 2.0, 4.0, 5.0, 5.0]
    assert waiting.tries == 4
    assert waiting.silent_s(22.0) == 12.0


def test_progress_begins_afresh_and_ends_the_wait_where_nothing_is_left() -> None:
    tried = after_silence(BEGUN, now_s=11.0)
    assert after_progress(tried, now_s=12.0, more=True).is_over(13.0)
    done = after_progress(tried, now_s=12.0, more=False)
    assert (done.is_over(1e9), done.silent_s(1e9), done.tries) == (False, 0.0, 0)


@pytest.mark.parametrize(("speed", "due_s"), [(1.0, 3.0), (2.0, 1.5), (0.5, 6.0), (0.0, 0.0)])
def test_a_message_is_due_in_recorded_time_over_speed(speed: float, due_s: float) -> None:
    assert reduce(after_stamp, (5 * S, 6 * S, 8 * S), Tempo(speed=speed)).due_s == due_s


def test_a_stamp_from_the_past_is_due_at_once_and_does_not_turn_time_back() -> None:
    assert reduce(after_stamp, (5 * S, 6 * S, 4 * S, 7 * S), Tempo(speed=1.0)).due_s == 2.0


def test_a_wild_stamp_is_waited_for_a_minute_at_most() -> None:
    assert reduce(after_stamp, (5 * S, 2**62), Tempo(speed=1.0)).due_s == 60.0

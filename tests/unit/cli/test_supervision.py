"""When a supervised process starts again."""

import pytest

from trigpoint.configuration.sections import UpSettings
from trigpoint_cli.supervision import Life, after_end, after_start, backoff_s, is_failing

SETTINGS = UpSettings(backoff_first_s=1.0, backoff_ceiling_s=10.0, steady_s=60.0, failing_count=3)


def ended(times: int, *, lived_s: float = 1.0) -> Life:
    life, now_s = Life(), 0.0
    for _ in range(times):
        life = after_start(life, now_s=now_s)
        now_s += lived_s
        life = after_end(life, 1, SETTINGS, now_s=now_s)
        now_s = life.due_s
    return life


@pytest.mark.parametrize(("ends", "wait_s"), [(1, 1.0), (2, 2.0), (3, 4.0), (4, 8.0), (5, 10.0), (5000, 10.0)])
def test_the_wait_doubles_up_to_its_ceiling(ends: int, wait_s: float) -> None:
    assert backoff_s(ends, SETTINGS) == wait_s


def test_a_process_that_ended_is_due_after_the_wait() -> None:
    life = ended(2)
    assert life.due_s == 1.0 + 1.0 + 1.0 + 2.0  # lived, waited, lived, and waits now
    assert not life.runs
    assert life.last_status == 1


def test_a_steady_life_takes_the_wait_back_to_the_first() -> None:
    life = after_start(ended(4), now_s=100.0)
    assert after_end(life, 1, SETTINGS, now_s=160.0).due_s == 161.0
    assert after_end(life, 1, SETTINGS, now_s=159.0).due_s == 169.0


def test_a_process_fails_after_so_many_ends_in_a_row() -> None:
    assert not is_failing(ended(2), SETTINGS, now_s=100.0)
    assert is_failing(ended(3), SETTINGS, now_s=100.0)


def test_a_process_that_fails_is_well_again_once_it_lived_steadily() -> None:
    life = after_start(ended(3), now_s=100.0)
    assert is_failing(life, SETTINGS, now_s=159.0)
    assert not is_failing(life, SETTINGS, now_s=160.0)


def test_the_first_start_is_no_restart() -> None:
    assert after_start(Life(), now_s=0.0).restarts == 0
    assert after_start(ended(2), now_s=9.0).restarts == 2

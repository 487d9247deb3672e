"""Who is to stop, and when it last looked."""

from trigpoint.observability.running import WatchedStop


class Clock:
    """A clock that is put forward by hand."""

    def __init__(self) -> None:
        self.time_s = 0.0

    def __call__(self) -> float:
        return self.time_s


def test_silence_counts_from_the_last_look() -> None:
    clock = Clock()
    stop = WatchedStop(now_s=clock)
    clock.time_s = 5.0
    assert not stop.is_set()
    clock.time_s = 7.0
    assert stop.silent_s == 2.0


def test_a_wait_counts_as_a_look_when_it_ends() -> None:
    clock = Clock()
    stop = WatchedStop(now_s=clock)
    stop.set()
    clock.time_s = 9.0
    assert stop.wait(100.0)
    clock.time_s = 10.0
    assert stop.silent_s == 1.0

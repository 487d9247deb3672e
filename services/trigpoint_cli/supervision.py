"""When a supervised process is started again, and when it is called failing: a fold over its starts and ends."""

from dataclasses import dataclass, replace

from trigpoint.configuration.sections import UpSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class Life:
    """A process's past. Times are of one steady clock; `ends_in_row` counts ends without a steady life between."""

    started_s: float | None = None
    due_s: float = 0.0
    ends_in_row: int = 0
    starts: int = 0
    last_status: int | None = None

    @property
    def runs(self) -> bool:
        """Whether it was started and has not ended."""
        return self.started_s is not None

    @property
    def restarts(self) -> int:
        """How often it was started anew."""
        return max(self.starts - 1, 0)


def after_start(life: Life, *, now_s: float) -> Life:
    """The life of a process that was started now."""
    return replace(life, started_s=now_s, starts=life.starts + 1)


def after_end(life: Life, status: int, settings: UpSettings, *, now_s: float) -> Life:
    """The life of a process that ended now: the next start is due after a wait that doubles up to its ceiling."""
    steady = life.started_s is not None and now_s - life.started_s >= settings.steady_s
    ends = 1 if steady else life.ends_in_row + 1
    return replace(life, started_s=None, due_s=now_s + backoff_s(ends, settings), ends_in_row=ends, last_status=status)


def backoff_s(ends_in_row: int, settings: UpSettings) -> float:
    """How long to wait after so many ends in a row."""
    doublings = min(ends_in_row - 1, 64)  # 2**64 first waits are beyond any ceiling
    return min(settings.backoff_first_s * 2.0**doublings, settings.backoff_ceiling_s)


def is_failing(life: Life, settings: UpSettings, *, now_s: float) -> bool:
    """Whether it ended too often in a row, and has not lived steadily since."""
    steady = life.started_s is not None and now_s - life.started_s >= settings.steady_s
    return life.ends_in_row >= settings.failing_count and not steady

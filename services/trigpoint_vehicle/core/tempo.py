"""When a recorded message is due: in recorded time, times a factor."""

from dataclasses import dataclass, replace

NS_PER_S = 1_000_000_000
PAUSE_LIMIT_S = 60.0  # of recorded time: a longer one between two drives, or a wild stamp, is not waited for


@dataclass(frozen=True, slots=True, kw_only=True)
class Tempo:
    """Recorded time has come to `stamp_ns`, `elapsed_s` after its beginning with no pause longer than the limit."""

    speed: float
    stamp_ns: int | None = None
    elapsed_s: float = 0.0

    @property
    def due_s(self) -> float:
        """How long after the beginning the message is due; 0 at speed 0, which is as fast as it goes."""
        return self.elapsed_s / self.speed if self.speed > 0.0 else 0.0


def after_stamp(tempo: Tempo, stamp_ns: int) -> Tempo:
    """The tempo with the next message's stamp; one from the past is due at once and does not turn time back."""
    if tempo.stamp_ns is None:
        return replace(tempo, stamp_ns=stamp_ns)
    if stamp_ns <= tempo.stamp_ns:
        return tempo
    passed_s = (stamp_ns - tempo.stamp_ns) / NS_PER_S
    return replace(tempo, stamp_ns=stamp_ns, elapsed_s=tempo.elapsed_s + min(passed_s, PAUSE_LIMIT_S))

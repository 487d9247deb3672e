"""How long to wait for an acknowledgement: longer each time none came."""

from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True, kw_only=True)
class Patience:
    """Waiting since `since_s` (None: for nothing), for `wait_s`; `tries` in a row, since `began_s`, were in vain."""

    first_s: float
    longest_s: float
    wait_s: float
    since_s: float | None = None
    began_s: float = 0.0
    tries: int = 0

    def silent_s(self, now_s: float) -> float:
        """How long it has been waiting without any progress, however often it tried."""
        return 0.0 if self.since_s is None else now_s - self.began_s

    def is_over(self, now_s: float) -> bool:
        """Whether what was sent should be sent again."""
        return self.since_s is not None and now_s - self.since_s >= self.wait_s


def patience(*, first_s: float, longest_s: float) -> Patience:
    """Waiting for nothing yet; the first wait is `first_s`, each further one twice as long, up to `longest_s`."""
    return Patience(first_s=first_s, longest_s=longest_s, wait_s=first_s)


def after_progress(waiting: Patience, *, now_s: float, more: bool) -> Patience:
    """After an acknowledgement of something: afresh for the rest, if there is `more`."""
    return replace(waiting, wait_s=waiting.first_s, since_s=now_s if more else None, began_s=now_s, tries=0)


def after_sending(waiting: Patience, *, now_s: float) -> Patience:
    """After sending: waiting from now on, unless it was waiting already."""
    return waiting if waiting.since_s is not None else replace(waiting, since_s=now_s, began_s=now_s)


def after_silence(waiting: Patience, *, now_s: float) -> Patience:
    """After a wait in vain: a longer one from now on."""
    longer_s = min(2.0 * waiting.wait_s, waiting.longest_s)
    return replace(waiting, wait_s=longer_s, since_s=now_s, tries=waiting.tries + 1)

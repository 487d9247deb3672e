"""What wakes up a service that reads the log: rung by a bus's callback, awaited by the service."""

import threading


class Bell:
    """Rings once however often it was rung since it was heard; once silenced it never rings again."""

    def __init__(self) -> None:
        self._rung, self._silenced = threading.Event(), False

    def ring(self) -> None:
        """Whoever waits goes on, or the next to wait does at once."""
        self._rung.set()

    def wait(self, timeout_s: float) -> bool:
        """Whether it was rung since it was heard last, or is within `timeout_s`; silenced: False at once."""
        if not self._rung.wait(timeout_s) or self._silenced:
            return False
        self._rung.clear()
        return not self._silenced

    def silence(self) -> None:
        """Nobody waits any more; again: no effect."""
        self._silenced = True
        self._rung.set()

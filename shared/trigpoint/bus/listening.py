"""The life of a service on live messages: it steps until it is told to stop, and is left in order or at once."""

import threading
from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self

from trigpoint.bus.ports import Subscription


class ListeningService(ABC):
    """Takes the messages of one subscription. Close it, or leave its `with`; an error there ends the listening only."""

    def __init__(self, subscription: Subscription, *, idle_s: float) -> None:
        self._subscription = subscription
        self._idle_s = idle_s

    @property
    def ready(self) -> bool:
        """Whether it has caught up; whoever only listens has nothing to catch up with."""
        return True

    @abstractmethod
    def step(self, timeout_s: float) -> bool:
        """One message taken, or none within the timeout (then False); what is due is appended."""

    @abstractmethod
    def close(self) -> None:
        """The subscription ended; what was taken is in the log."""

    def run(self, stop: threading.Event) -> None:
        """Steps until told to stop, `idle_s` between two looks at an empty queue.

        Raises AppendFailed when the log cannot be written: then it must stop.
        """
        while not stop.is_set():
            if not self.step(0.0):
                stop.wait(self._idle_s)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self._subscription.close()

"""Zenoh's callback threads, and how to see them out."""

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

import zenoh

Item = TypeVar("Item")

ENDING_LONGEST_S = 5.0  # a callback only queues what came


class JoinedCallback(Generic[Item]):
    """A callback whose thread can be joined once its declaration is undeclared.

    Zenoh runs each callback in a Python thread that is a daemon where a daemon thread declared it. One that still runs
    when the interpreter ends aborts the process, because it cannot unwind through Zenoh's own frames.
    """

    def __init__(self, called: Callable[[Item], object]) -> None:
        self._thread: threading.Thread | None = None
        self._is_ending = threading.Event()
        self.handler: zenoh.handlers.Callback[Item] = zenoh.handlers.Callback(called, self._ending)

    def _ending(self) -> None:
        self._thread = threading.current_thread()
        self._is_ending.set()

    def join(self, timeout_s: float = ENDING_LONGEST_S) -> bool:
        """Whether the thread has ended, at once or within the time; only to be asked after undeclaring."""
        if not self._is_ending.wait(timeout_s) or self._thread is None:
            return False
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

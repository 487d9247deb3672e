"""When a process has to stop: on SIGTERM or SIGINT, or when the process that started it is gone."""

import os
import select
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

STOPPING = (signal.SIGTERM, signal.SIGINT)
READ_BYTES = 4096


@dataclass(frozen=True, slots=True)
class StopRequests:
    """What may tell this process to stop; the main thread's only."""

    signalled: int
    standard_input: int | None

    def wait(self, timeout_s: float) -> str | None:
        """Why to stop, or None if there was no reason within the timeout."""
        watched = [self.signalled] if self.standard_input is None else [self.signalled, self.standard_input]
        readable, _, _ = select.select(watched, [], [], timeout_s)
        if self.signalled in readable:
            number = os.read(self.signalled, 1)[0]
            return signal.Signals(number).name
        if readable and not os.read(readable[0], READ_BYTES):
            return "standard input ended: whoever started this process is gone"
        return None


@contextmanager
def stop_requests(*, with_standard_input: bool = False) -> Iterator[StopRequests]:
    """Signals taken as requests while it is open, and as before after it.

    A signal only writes its number into a pipe: nothing of ours runs inside of a handler.
    """
    signalled, writing = os.pipe()
    os.set_blocking(writing, False)
    before = {number: signal.signal(number, lambda *_: None) for number in STOPPING}
    wakeup = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    try:
        yield StopRequests(signalled, sys.stdin.fileno() if with_standard_input else None)
    finally:
        signal.set_wakeup_fd(wakeup)
        for number, handler in before.items():
            signal.signal(number, handler)
        os.close(signalled)
        os.close(writing)

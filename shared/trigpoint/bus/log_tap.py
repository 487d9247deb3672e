"""What Zenoh writes of itself on standard output, read instead of shown: it offers no other way."""

import os
import sys
import threading
from collections.abc import Callable
from typing import TextIO

import zenoh

STANDARD_OUTPUT = 1
PIECE_BYTES = 1 << 20


class LogTap:
    """While it is open, this process's standard output goes to `hear`, in a thread of its own, and Python's own
    output where standard output went before. One a process: Zenoh takes its levels once.
    """

    def __init__(self, levels: str, hear: Callable[[bytes], None]) -> None:
        self._hear = hear
        sys.stdout.flush()
        self._before = os.dup(STANDARD_OUTPUT)
        self._output: TextIO = sys.stdout
        reading, writing = os.pipe()
        os.dup2(writing, STANDARD_OUTPUT)
        os.close(writing)
        sys.stdout = os.fdopen(os.dup(self._before), "w", encoding="utf-8")
        self._thread = threading.Thread(target=self._listen, args=(reading,), name="log-tap", daemon=True)
        self._thread.start()
        os.unsetenv("NO_COLOR")  # its lines are told from forged ones by their escape characters
        zenoh.init_log_from_env_or(levels)

    def _listen(self, reading: int) -> None:
        with os.fdopen(reading, "rb", buffering=0) as pipe:
            while piece := pipe.read(PIECE_BYTES):
                self._hear(piece)

    def close(self) -> None:
        """Standard output as it was; what Zenoh wrote before was heard."""
        sys.stdout.close()
        os.dup2(self._before, STANDARD_OUTPUT)  # the last writing end of the pipe: the listener comes to its end
        os.close(self._before)
        sys.stdout = self._output
        self._thread.join()

"""Vehicles' logs travelling over Zenoh, in process: a replayer and ingest, each with a session of its own."""

import socket
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.logs.ports import RecallingLog
from trigpoint_ingest.app import IngestService
from trigpoint_ingest.core.tally import IngestReport
from trigpoint_ingest.settings import IngestSettings
from trigpoint_vehicle.replay import replay_log

IDLE_S = 0.02  # how long ingest waits for a message before it looks whether the drives are over
LOOPBACK = "127.0.0.1"

Progress = Callable[[int], None]


class _Replaying(threading.Thread):
    """The drives sent one after the other; `error` is what ended them early, if anything."""

    def __init__(self, paths: Sequence[Path], endpoint: str, progress: Progress) -> None:
        super().__init__(name="replaying", daemon=True)
        self._paths, self._endpoint, self._progress = paths, endpoint, progress
        self.error: Exception | None = None

    def run(self) -> None:
        try:
            with ZenohBus(ZenohSettings(connect=(self._endpoint,))) as bus:
                for path in self._paths:
                    replay_log(path, bus, progress=self._progress)
        except Exception as error:  # carried to the thread that waits for this one, and raised there
            self.error = error


def free_endpoint() -> str:
    """A TCP endpoint on loopback that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return f"tcp/{LOOPBACK}:{probe.getsockname()[1]}"


def ingest_live(paths: Sequence[Path], log: RecallingLog, progress: Progress) -> IngestReport:
    """What came of vehicles' logs sent over the bus, every message acknowledged after it was durable.

    Raises what ended the sending or the ingest: AppendFailed, or ServiceError if messages stay unacknowledged.
    """
    endpoint = free_endpoint()
    with ZenohBus(ZenohSettings(listen=(endpoint,))) as bus:
        service = IngestService(log, bus, IngestSettings())
        with service:
            replaying = _Replaying(paths, endpoint, progress)
            replaying.start()
            while replaying.is_alive():
                service.step(IDLE_S)
            replaying.join()
        if replaying.error is not None:
            raise replaying.error
        return service.report()

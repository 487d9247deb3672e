"""The fleet's Zenoh router as a process of its own."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from trigpoint.bus.zenoh_bus import ZenohBus
from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_cli.settings import Settings


class Router:
    """A session that passes on what others publish, until it is told to stop."""

    def __init__(self, bus: ZenohBus) -> None:
        self._bus = bus

    @property
    def ready(self) -> bool:
        """True: its endpoints are open since it was made."""
        return True

    def run(self, stop: threading.Event) -> None:
        """Waits; Zenoh's own threads do the work."""
        stop.wait()

    def close(self) -> None:
        """The session ended."""
        self._bus.close()


@contextmanager
def opened(settings: Settings, instruments: Instruments) -> Iterator[Service]:
    """A router session of the configuration. Raises ServiceError where an endpoint cannot be had."""
    with ZenohBus(settings.router) as bus:
        yield Router(bus)

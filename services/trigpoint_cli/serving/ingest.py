"""Ingest as a process of its own."""

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_cli.serving.resources import opened_resources
from trigpoint_cli.serving.sealing import sealing
from trigpoint_cli.settings import Settings
from trigpoint_ingest.app import IngestService

SWITCH_S = 0.0005  # a commit waits for the interpreter some hundred times, and by default up to 5 ms each time


@contextmanager
def opened(settings: Settings, instruments: Instruments) -> Iterator[Service]:
    """Ingest on the fleet's log and bus."""
    with opened_resources(settings) as resources, sealing(resources.log):
        service = IngestService(resources.log, resources.bus, settings.ingest, instruments=instruments)
        _make_prompt()
        yield service


def _make_prompt() -> None:
    """Threads get their turn soon, and garbage is looked for only among what is made from now on: to look through all
    that was loaded takes a tenth of a second, for which nothing would be acknowledged."""
    sys.setswitchinterval(SWITCH_S)
    gc.collect()
    gc.freeze()

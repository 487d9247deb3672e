"""Ingest as a process of its own."""

from collections.abc import Iterator
from contextlib import contextmanager

from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_cli.serving.resources import opened_resources
from trigpoint_cli.serving.sealing import sealing
from trigpoint_cli.settings import Settings
from trigpoint_ingest.app import IngestService


@contextmanager
def opened(settings: Settings, instruments: Instruments) -> Iterator[Service]:
    """Ingest on the fleet's log and bus."""
    with opened_resources(settings) as resources, sealing(resources.log):
        yield IngestService(resources.log, resources.bus, settings.ingest, instruments=instruments)

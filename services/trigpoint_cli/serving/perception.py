"""Perception as a process of its own."""

from collections.abc import Iterator
from contextlib import contextmanager

from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_cli.serving.resources import data_of, opened_resources
from trigpoint_cli.serving.sealing import sealing
from trigpoint_cli.settings import Settings
from trigpoint_perception.live import LivePerception


@contextmanager
def opened(settings: Settings, instruments: Instruments) -> Iterator[Service]:
    """Perception on the fleet's log and bus."""
    with opened_resources(settings) as resources, sealing(resources.log):
        yield LivePerception(
            resources.log,
            resources.bus,
            root=settings.fleet.root,
            checkpoint=data_of(settings).path / "checkpoints" / "perception",
            instruments=instruments,
        )

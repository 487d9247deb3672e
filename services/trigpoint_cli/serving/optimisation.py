"""Optimisation as a process of its own."""

from collections.abc import Iterator
from contextlib import contextmanager

from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_cli.serving.resources import opened_resources
from trigpoint_cli.serving.sealing import sealing
from trigpoint_cli.settings import Settings
from trigpoint_optimisation.live import LiveOptimisation
from trigpoint_optimisation.whole_solve import SolverProcess


@contextmanager
def opened(settings: Settings, instruments: Instruments) -> Iterator[Service]:
    """Optimisation on the fleet's log and bus, whole solves in processes of their own."""
    with opened_resources(settings) as resources, sealing(resources.log):
        yield LiveOptimisation(
            resources.log,
            SolverProcess(resources.log.directory, settings.optimisation),
            resources.bus,
            settings=settings.optimisation,
            names=(settings.fleet.root, settings.fleet.map),
            instruments=instruments,
        )

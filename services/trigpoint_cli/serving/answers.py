"""The map's answers over the bus as a process of its own."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from trigpoint.landmarks.opening import opened_store
from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_cli.serving.resources import database_url, opened_resources
from trigpoint_cli.settings import Settings
from trigpoint_landmarks.answering.observed import ObservedTiles
from trigpoint_landmarks.answering.service import MapAnswers


@contextmanager
def opened(settings: Settings, instruments: Instruments) -> Iterator[Service]:
    """Answers from the fleet's database and log, which it only reads."""
    open_store = partial(
        opened_store, database_url(settings), password_file=settings.database.password_file, read_only=True
    )
    with opened_resources(settings) as resources:
        yield MapAnswers(
            resources.bus,
            open_store,
            ObservedTiles(resources.log, tiles_most=settings.answers.tiles_most),
            names=(settings.fleet.root, settings.fleet.map),
            settings=settings.answers,
            instruments=instruments,
        )

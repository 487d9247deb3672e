"""The map's answers over the bus as a process of its own."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from trigpoint.errors import DatabaseUnavailable
from trigpoint.landmarks.opening import geopackage_path, opened_store
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_cli.serving.resources import database_url, opened_resources
from trigpoint_cli.settings import Settings
from trigpoint_landmarks.answering.observed import ObservedTiles
from trigpoint_landmarks.answering.service import MapAnswers


@contextmanager
def opened(settings: Settings, instruments: Instruments) -> Iterator[Service]:
    """Answers from the fleet's database and log, which it only reads."""
    with opened_resources(settings) as resources:
        yield MapAnswers(
            resources.bus,
            partial(read_store, settings),
            ObservedTiles(resources.log, tiles_most=settings.answers.tiles_most),
            names=(settings.fleet.root, settings.fleet.map),
            settings=settings.answers,
            instruments=instruments,
        )


def read_store(settings: Settings) -> LandmarkStore:
    """The landmark database, to be read. Raises DatabaseUnavailable for a file that the projection has yet to make, and
    as `opened_store` does."""
    url = database_url(settings)
    file = geopackage_path(url)
    if file is not None and not (file.is_file() and file.stat().st_size):  # empty while its tables are being made
        raise DatabaseUnavailable(f"no landmark database at {file} yet")
    return opened_store(url, password_file=settings.database.password_file, read_only=True)

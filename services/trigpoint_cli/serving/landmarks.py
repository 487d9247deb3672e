"""The projection into the landmark database as a process of its own."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from trigpoint.landmarks.opening import opened_store
from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_cli.serving.resources import database_url, opened_resources
from trigpoint_cli.settings import Settings
from trigpoint_landmarks.change_feed import ChangeFeed, FeedingStore
from trigpoint_landmarks.live import LandmarkProjection


@contextmanager
def opened(settings: Settings, instruments: Instruments) -> Iterator[Service]:
    """The projection of the fleet's log into its database, woken up by its bus, telling of what it made durable."""
    open_store = partial(opened_store, database_url(settings), password_file=settings.database.password_file)
    fleet = settings.fleet
    with (
        opened_resources(settings) as resources,
        ChangeFeed(resources.bus, root=fleet.root, map_name=fleet.map) as feed,
    ):
        yield LandmarkProjection(
            resources.log,
            lambda: FeedingStore(open_store(), feed),
            bus=resources.bus,
            root=settings.fleet.root,
            settings=settings.landmarks,
            instruments=instruments,
        )

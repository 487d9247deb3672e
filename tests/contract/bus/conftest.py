"""What the contracts of every bus are held against."""

from collections.abc import Iterator

import pytest

from bus_sessions.pairs import paired
from trigpoint.bus.ports import Bus


@pytest.fixture(params=["memory", "zenoh"])
def pair(request: pytest.FixtureRequest) -> Iterator[tuple[Bus, Bus]]:
    """Two sessions that hear each other: one to publish, one to listen."""
    with paired(request.param) as sessions:
        yield sessions

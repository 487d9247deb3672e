"""The map asked as a fleet runs it: router, projection and answers as processes of their own, and a client."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from command_runs.processes import Fleet, fleet_in, free_ports, trigpoint_process, wait_until
from landmark_maps.examples import append_mapped, landmark, pin_frame, solved_landmark, solved_map
from trigpoint.bus.zenoh_bus import ZenohSettings
from trigpoint.client.asking import MapClient, connected_client
from trigpoint.client.local_map import LocalMap
from trigpoint.errors import MapUnanswered
from trigpoint.landmarks.queries import DegreeBox, LandmarkQuery
from trigpoint.logs.mcap_log import McapLog

SOON_S = 60.0
HERE = landmark("here", 0.0, 0.0)
AROUND = DegreeBox(
    lon_min_deg=HERE.lon_deg - 0.002,
    lat_min_deg=HERE.lat_deg - 0.002,
    lon_max_deg=HERE.lon_deg + 0.002,
    lat_max_deg=HERE.lat_deg + 0.002,
)


def append_version(log: McapLog, map_version: int, *places_m: tuple[float, float]) -> None:
    """A whole version with landmarks L1, L2, … at these places."""
    rows = [
        solved_landmark(f"L{number}", x_m, y_m, map_version=map_version)
        for number, (x_m, y_m) in enumerate(places_m, start=1)
    ]
    append_mapped(log, solved_map(map_version, rows))


@contextmanager
def served(folder: Path) -> Iterator[tuple[Fleet, McapLog, MapClient]]:
    """A fleet whose map has a first version; answers are started before the projection has made the database."""
    (port,) = free_ports(1)
    fleet = fleet_in(folder, toml=f"answers_port = {port}\n")
    fleet.ports["answers"] = port
    log = McapLog(fleet.data / "log")
    pin_frame(log)
    append_version(log, 1, (1.0, 2.0), (30.0, 4.0))
    with ExitStack() as stack:
        stack.callback(log.close)
        for words in (("router",), ("serve", "answers"), ("serve", "landmarks")):
            stack.enter_context(trigpoint_process(folder, *words, "--config", fleet.config))
        fleet.wait_ready("router", "landmarks", "answers")
        settings = ZenohSettings(mode="client", connect=(fleet.endpoint,), connect_timeout_s=30.0)
        yield fleet, log, stack.enter_context(connected_client(settings, timeout_s=SOON_S))


def is_answered(client: MapClient) -> bool:
    """Whether the queryable is known through the router, and has the first version."""
    try:
        return client.landmarks(LandmarkQuery(limit=1)).map.map_version >= 1
    except MapUnanswered:
        return False


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Fleet, McapLog, MapClient]]:
    with served(tmp_path_factory.mktemp("answers")) as found:
        wait_until(lambda: is_answered(found[2]), "an answer")
        yield found


def test_what_is_appended_to_the_log_reaches_a_local_map(fleet: tuple[Fleet, McapLog, MapClient]) -> None:
    _, log, client = fleet
    with LocalMap(client, AROUND, look_s=600.0) as local:
        assert local.await_version(1, SOON_S)
        append_version(log, 2, (1.5, 2.0))
        assert local.await_version(2, SOON_S)
        assert [(row.landmark, row.x_m) for row in local.landmarks(LandmarkQuery())] == [("L1", 1.5)]
    changes = client.changes(1)
    assert ([row.landmark for row in changes.changed], changes.removed) == (["L1"], ("L2",))
    assert len(client.landmarks(LandmarkQuery(as_of=1)).landmarks) == 2


def test_coverage_is_answered_from_the_log(fleet: tuple[Fleet, McapLog, MapClient]) -> None:
    assert fleet[2].coverage().map.map_version >= 1


def test_answers_are_counted(fleet: tuple[Fleet, McapLog, MapClient]) -> None:
    status, text = fleet[0].page("answers", "/metrics")
    assert (status, "trigpoint_answers_total" in text) == (200, True)

"""Who may answer for the map, who may ask it, and who may tell of its changes, through the router's rules."""

from collections.abc import Iterator

import pytest

from command_runs.processes import comes_true
from landmark_maps.examples import change, checkpoint, landmark
from map_answers.answering import SOON_S, answered
from secured_fleet.fleet import SecuredFleet, secured_fleet
from trigpoint.bus.ports import Bus, BusMessage, Content
from trigpoint.bus.register import Role
from trigpoint.client.asking import MapClient
from trigpoint.client.local_map import LocalMap
from trigpoint.errors import MapUnanswered
from trigpoint.events.envelope import EventIdentity
from trigpoint.landmarks.memory_store import MemoryStore
from trigpoint.landmarks.queries import DegreeBox, LandmarkQuery
from trigpoint_landmarks.change_feed import ChangeFeed, FeedingStore

ROOT, MAP = "trigpoint", "main"
ASK = f"{ROOT}/v1/map/{MAP}/ask/landmarks"
CHANGE = f"{ROOT}/v1/map/{MAP}/changes/version"
NEVER_S = 1.0
HERE = landmark("L1", 0.0, 0.0)
AROUND = DegreeBox(
    lon_min_deg=HERE.lon_deg - 1e-3,
    lat_min_deg=HERE.lat_deg - 1e-3,
    lon_max_deg=HERE.lon_deg + 1e-3,
    lat_max_deg=HERE.lat_deg + 1e-3,
)


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SecuredFleet]:
    with secured_fleet(tmp_path_factory.mktemp("questions") / "fleet") as fleet:
        fleet.issue("answers", Role.ANSWERS)
        fleet.issue("landmarks", Role.LANDMARKS)
        yield fleet


def told(key: str) -> BusMessage:
    return BusMessage(key=key, schema_name="x", payload=b"x", identity=EventIdentity("x", "x", 0), stamp_ns=0)


def is_answered(client: MapClient) -> bool:
    try:
        return bool(client.landmarks(LandmarkQuery(limit=1)).landmarks)
    except MapUnanswered:
        return False


def answers_reach(asking: Bus, answering: Bus) -> bool:
    """Whether a queryable of one session is asked by the other."""
    queryable = answering.queryable(ASK)
    try:
        asking.await_queryable(ASK, NEVER_S)
        asking.get(ASK, Content(b"?"), timeout_s=NEVER_S)
        return queryable.receive(0.0) is not None
    finally:
        queryable.close()


@pytest.mark.parametrize("asker", ["viewer", "veh-a"])
def test_clients_and_vehicles_ask_and_follow_through_the_router(fleet: SecuredFleet, asker: str) -> None:
    store = MemoryStore()
    store.apply(change(1, opened=[HERE]), checkpoint(1))
    with (
        fleet.session("answers") as answering,
        fleet.session("landmarks") as telling,
        fleet.session(asker) as asking,
        answered(store, answering, names=(ROOT, MAP), tells=False),
        ChangeFeed(telling, root=ROOT, map_name=MAP) as feed,
    ):
        client = MapClient(asking, timeout_s=SOON_S)
        assert comes_true(lambda: is_answered(client))
        with LocalMap(client, AROUND, look_s=600.0) as local:
            assert local.await_version(1, SOON_S)
            assert telling.await_listener(CHANGE, SOON_S)
            FeedingStore(store, feed).apply(change(2, closed=["L1"]), checkpoint(2))
            assert local.await_version(2, SOON_S)
    assert fleet.refusals() == []


def test_a_vehicle_answers_nothing_for_the_map(fleet: SecuredFleet) -> None:
    with fleet.session("viewer") as asking, fleet.session("veh-a") as answering:
        assert not answers_reach(asking, answering)


def test_only_landmarks_tells_of_changes(fleet: SecuredFleet) -> None:
    with (
        fleet.session("viewer") as listening,
        fleet.session("veh-b") as intruder,
        fleet.session("landmarks") as rightful,
    ):
        heard = listening.subscribe(f"{ROOT}/v1/map/{MAP}/changes/**")
        assert rightful.await_listener(CHANGE, SOON_S)
        intruder.publish(told(CHANGE))
        rightful.publish(told(CHANGE.replace("version", "16/1/1")))
        message = heard.receive(SOON_S)
        assert message is not None
        assert message.key.endswith("16/1/1")

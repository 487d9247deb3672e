"""A client of the map over real Zenoh: two sessions over loopback TCP, scouting off."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from landmark_maps.examples import change, checkpoint, frame, landmark
from map_answers.answering import MAP, ROOT, SOON_S, AnsweredStore, answered, zenoh_pair
from trigpoint.bus.memory_bus import MemoryBus
from trigpoint.client.asking import MapClient
from trigpoint.client.asking_async import AsyncMapClient
from trigpoint.client.core.constellations import Constellation
from trigpoint.client.core.known_landmarks import GnssPrior
from trigpoint.client.core.placing import VehiclePose
from trigpoint.client.core.relocalisation import Verdict
from trigpoint.client.local_map import LocalMap
from trigpoint.errors import InputError, MapUnanswered
from trigpoint.geodesy.poses import Pose2
from trigpoint.landmarks.memory_store import MemoryStore
from trigpoint.landmarks.queries import DegreeBox, LandmarkQuery

PLACES_M = [(0, 0), (14, 3), (31, -8), (47, 12), (-12, 22), (9, -25), (38, 33), (-30, -14), (60, -20), (-21, 41)]
ROWS = {f"L{n}": landmark(f"L{n}", float(x_m), float(y_m)) for n, (x_m, y_m) in enumerate(PLACES_M)}
NEAR = DegreeBox(  # some 200 m around L0: one tile or few
    lon_min_deg=ROWS["L0"].lon_deg - 0.001,
    lat_min_deg=ROWS["L0"].lat_deg - 0.001,
    lon_max_deg=ROWS["L0"].lon_deg + 0.001,
    lat_max_deg=ROWS["L0"].lat_deg + 0.001,
)
FAR = landmark("FAR", 9_000.0, 0.0)


@contextmanager
def over_zenoh(*, tells: bool = True) -> Iterator[tuple[AnsweredStore, MapClient]]:
    """A map that answers, and a client in another session."""
    store = MemoryStore()
    store.apply(change(1, opened=[*ROWS.values(), FAR]), checkpoint(1))
    with zenoh_pair() as (serving, asking), answered(store, serving, tells=tells) as there:
        client = MapClient(asking, root=ROOT, map_name=MAP, timeout_s=SOON_S)
        assert asking.await_queryable(f"{ROOT}/v1/map/{MAP}/ask/landmarks", SOON_S)
        yield there, client


def ids(local: LocalMap) -> set[str]:
    return {row.landmark for row in local.landmarks(LandmarkQuery())}


def test_questions_are_answered_over_the_network() -> None:
    with over_zenoh() as (_, client):
        answer = client.landmarks(LandmarkQuery(bbox=NEAR))
        assert {row.landmark for row in answer.landmarks} == set(ROWS)
        assert answer.landmarks[0]._replace(provenance=ROWS["L0"].provenance) == ROWS["L0"]


def test_the_asyncio_twin_gives_the_same_answers() -> None:
    with over_zenoh() as (_, client):
        twin = AsyncMapClient(client.bus, root=ROOT, map_name=MAP, timeout_s=SOON_S)

        async def both() -> tuple[object, object]:
            return await twin.landmarks(LandmarkQuery(bbox=NEAR)), await twin.changes(1)

        assert asyncio.run(both()) == (client.landmarks(LandmarkQuery(bbox=NEAR)), client.changes(1))


def test_the_asyncio_twin_waits_for_several_answers_at_once() -> None:
    with over_zenoh() as (_, client):
        twin = AsyncMapClient(client.bus, root=ROOT, map_name=MAP, timeout_s=SOON_S)

        async def many() -> list[int]:
            answers = await asyncio.gather(*(twin.landmarks(LandmarkQuery(limit=n)) for n in range(1, 6)))
            return [len(answer.landmarks) for answer in answers]

        assert asyncio.run(many()) == [1, 2, 3, 4, 5]


def test_a_refusal_is_the_clients_to_mend() -> None:
    with over_zenoh() as (_, client), pytest.raises(InputError, match="map version 9 is unknown: 1 to 1 are there"):
        client.landmarks(LandmarkQuery(as_of=9))


def test_nobody_to_answer_is_told() -> None:
    with MemoryBus() as bus, pytest.raises(MapUnanswered, match="nobody answers on"):
        MapClient(bus, timeout_s=0.01).landmarks()


def test_a_local_map_holds_the_tiles_of_its_area() -> None:
    with over_zenoh() as (_, client), LocalMap(client, NEAR) as local:
        assert local.await_version(1, SOON_S)
        assert ids(local) == set(ROWS)


def test_a_local_map_follows_what_is_told() -> None:
    with over_zenoh() as (there, client), LocalMap(client, NEAR, look_s=600.0) as local:
        assert local.await_version(1, SOON_S)
        there.store.apply(change(2, opened=[landmark("L1", 15.0, 3.0)], closed=["L1", "L2"]), checkpoint(2))
        assert local.await_version(2, SOON_S)
        moved = {row.landmark: row.x_m for row in local.landmarks(LandmarkQuery())}
        assert (moved["L1"], "L2" in moved, len(moved)) == (15.0, False, len(ROWS) - 1)
        assert local.heals == 1  # the first reading: nothing else had to be asked


def test_a_landmark_leaves_the_area_and_comes_into_it() -> None:
    with over_zenoh() as (there, client), LocalMap(client, NEAR, look_s=600.0) as local:
        assert local.await_version(1, SOON_S)
        gone, come = landmark("L0", 9_000.0, 9.0), landmark("FAR", 1.0, 1.0)
        there.store.apply(change(2, opened=[gone, come], closed=["L0", "FAR"]), checkpoint(2))
        assert local.await_version(2, SOON_S)
        assert ids(local) == (set(ROWS) - {"L0"}) | {"FAR"}


def test_a_version_without_change_in_the_area_is_held_at_once() -> None:
    with over_zenoh() as (there, client), LocalMap(client, NEAR, look_s=600.0) as local:
        assert local.await_version(1, SOON_S)
        there.store.apply(change(2, closed=["FAR"]), checkpoint(2))
        assert local.await_version(2, SOON_S)
        assert (ids(local), local.heals) == (set(ROWS), 1)


def test_a_gap_is_seen_in_the_next_version_and_healed() -> None:
    with over_zenoh() as (there, client), LocalMap(client, NEAR, look_s=600.0) as local:
        assert local.await_version(1, SOON_S)
        there.silent.apply(change(2, closed=["L3"]), checkpoint(2))  # durable, and told of to nobody
        there.store.apply(change(3, closed=["L4"]), checkpoint(3))
        assert local.await_version(3, SOON_S)
        assert (ids(local), local.heals) == (set(ROWS) - {"L3", "L4"}, 2)


def test_what_nobody_told_of_is_found_by_looking() -> None:
    with over_zenoh(tells=False) as (there, client), LocalMap(client, NEAR, look_s=0.05) as local:
        assert local.await_version(1, SOON_S)
        there.store.apply(change(2, closed=["L3"]), checkpoint(2))
        assert local.await_version(2, SOON_S)
        assert ids(local) == set(ROWS) - {"L3"}


def test_a_local_map_says_how_stale_it_is_and_stays_while_nobody_answers() -> None:
    seconds = iter(range(10_000_000))
    with over_zenoh() as (_, client), LocalMap(client, NEAR, look_s=0.05, now_s=lambda: float(next(seconds))) as local:
        assert local.await_version(1, SOON_S)
        stale = local.staleness()
        assert (stale.held_version, stale.newest_version, stale.unconfirmed_s < float("inf")) == (1, 1, True)


def test_a_local_map_outlives_its_bus_and_stays_as_it_was() -> None:
    with over_zenoh() as (_, client), LocalMap(client, NEAR, look_s=0.05) as local:
        assert local.await_version(1, SOON_S)
        client.bus.close()
        assert ids(local) == set(ROWS)


def test_detections_are_placed_by_the_maps_own_frame() -> None:
    pose = VehiclePose(T_map_base=np.array([4.0, 3.0, 0.0]), covariance=0.01 * np.eye(3))
    ahead = Constellation(point_m=np.array([[10.0, 0.0]]), covariance_m2=0.04 * np.eye(2)[None], kind=("pole",))
    with over_zenoh() as (_, client):
        found = client.place(ahead, pose)
    there = landmark("there", 4.0 + 10.0 * frame().point_scale, 3.0)
    # The same projection on both ways: rounding only, 1e-9 degrees are 0.1 mm.
    assert (found.lat_deg[0], found.lon_deg[0]) == pytest.approx((there.lat_deg, there.lon_deg), abs=1e-9)


def test_a_vehicle_finds_itself_among_landmarks_it_asks_for_and_among_those_held() -> None:
    truth = Pose2(10.0, 5.0, 0.4)
    T_base_map = truth.inverse()
    seen = Constellation(
        point_m=np.array([T_base_map.transform(float(x_m), float(y_m)) for x_m, y_m in PLACES_M[:7]]),
        covariance_m2=np.tile(0.05**2 * np.eye(2), (7, 1, 1)),
        kind=("pole",) * 7,
    )
    beside = landmark("beside", 14.0, -1.0)
    prior = GnssPrior(lat_deg=beside.lat_deg, lon_deg=beside.lon_deg, sigma_m=15.0)
    with over_zenoh() as (_, client), LocalMap(client, NEAR) as local:
        assert local.await_version(1, SOON_S)
        asked, held = client.relocalise(seen, prior), local.relocalise(seen, prior)
    assert asked is not None
    assert held is not None
    assert (asked.verdict, held.verdict) == (Verdict.CONFIDENT, Verdict.CONFIDENT)
    # Exact observations; the rest is 0.04 % between metres on the ground and on the grid, over 50 m.
    assert asked.T_map_base == pytest.approx([truth.x_m, truth.y_m, truth.heading_rad], abs=0.05)
    assert np.array_equal(asked.T_map_base, held.T_map_base)

"""The landmarks in memory are found as a store finds them, whatever was changed before."""

from dataclasses import replace

import numpy as np
import pytest

from landmark_maps.examples import SECOND_NS, START_NS, change, checkpoint, landmark
from trigpoint.landmarks.asked import AnsweredMap
from trigpoint.landmarks.memory_store import MemoryStore
from trigpoint.landmarks.messages import landmark_of, parsed
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.queries import DegreeBox, Disc, LandmarkQuery, Nearest, PageMark, TimeSpan
from trigpoint_landmarks.answering.memory_index import MemoryIndex
from trigpoint_schemas.v1 import asked_pb2 as pb

HERE = landmark("here", 123.0, -45.0)
BOX = DegreeBox(
    lon_min_deg=HERE.lon_deg - 0.003,
    lat_min_deg=HERE.lat_deg - 0.004,
    lon_max_deg=HERE.lon_deg + 0.005,
    lat_max_deg=HERE.lat_deg + 0.002,
)
EVERYWHERE = DegreeBox(lon_min_deg=-180.0, lat_min_deg=-90.0, lon_max_deg=180.0, lat_max_deg=90.0)
DISC = Disc(lat_deg=HERE.lat_deg, lon_deg=HERE.lon_deg, radius_m=350.0)
NEAREST = Nearest(lat_deg=HERE.lat_deg, lon_deg=HERE.lon_deg, count=40)
QUERIES = {
    "all": LandmarkQuery(),
    "limited": LandmarkQuery(limit=7, after=PageMark(landmark="L17")),
    "box": LandmarkQuery(bbox=BOX),
    "everywhere": LandmarkQuery(bbox=EVERYWHERE),
    "disc": LandmarkQuery(near=DISC),
    "disc and box": LandmarkQuery(near=DISC, bbox=BOX, limit=9),
    "after a distance": LandmarkQuery(near=DISC, after=PageMark(landmark="L0", distance_m=200.0)),
    "nearest": LandmarkQuery(nearest=NEAREST),
    "nearest, far away": LandmarkQuery(nearest=Nearest(lat_deg=50.0, lon_deg=8.0, count=3)),
    "more than there are": LandmarkQuery(nearest=replace(NEAREST, count=5_000)),
    "kinds": LandmarkQuery(kinds=("corner", "unheard of")),
    "certain": LandmarkQuery(max_sigma_m=0.15),
    "vehicle": LandmarkQuery(vehicle="veh-a", bbox=BOX),
    "seen": LandmarkQuery(seen=TimeSpan(first_ns=START_NS + 100 * SECOND_NS, last_ns=START_NS + 200 * SECOND_NS)),
}


def crowd() -> tuple[list[Landmark], list[Landmark]]:
    at_m = np.random.default_rng(5).uniform(-1000.0, 1000.0, (1500, 2)).tolist()
    rows = [
        landmark(f"L{n}", *at_m[n], kind=("pole", "corner", "")[n % 3])._replace(
            sigma_major_m=0.1 + 0.01 * (n % 20),
            vehicles=(("veh-a",), ("veh-b", "veh-a"), ())[n % 3],
            first_seen_ns=START_NS + n * SECOND_NS,
            last_seen_ns=START_NS + (n + n % 60) * SECOND_NS,
        )
        for n in range(1200)
    ]
    return rows, [landmark(f"L{3 * n}", *at_m[1200 + n])._replace(valid_from_version=2) for n in range(300)]


@pytest.fixture(scope="module")
def both() -> tuple[MemoryIndex, MemoryStore]:
    """1,200 landmarks of which a quarter moved and a few went, in the index and in a store."""
    index, store = MemoryIndex(), MemoryStore()
    rows, moved = crowd()
    gone = [f"L{n}" for n in range(1, 40, 3)]
    store.apply(change(1, opened=rows), checkpoint(1))
    store.apply(change(2, opened=moved, closed=[*gone, *(row.landmark for row in moved)]), checkpoint(2))
    index.change(rows, ())
    index.change(moved, gone)
    return index, store


@pytest.mark.parametrize("name", QUERIES)
def test_the_index_finds_what_a_store_finds(both: tuple[MemoryIndex, MemoryStore], name: str) -> None:
    index, store = both
    found = index.found(QUERIES[name])
    assert [index.name(slot) for slot in found.slots] == [row.landmark for row in store.landmarks(QUERIES[name])] != []


def test_the_index_says_whether_more_would_follow(both: tuple[MemoryIndex, MemoryStore]) -> None:
    index, store = both
    count = len(store.landmarks(LandmarkQuery()))
    assert index.found(LandmarkQuery(limit=count - 1)).more
    assert not index.found(LandmarkQuery(limit=count)).more


def test_a_landmark_comes_back_as_it_was_but_for_its_provenance(both: tuple[MemoryIndex, MemoryStore]) -> None:
    index, store = both
    of = AnsweredMap(map_version=2, origin_easting_m=332_000.0, origin_northing_m=6_248_000.0)
    slots = index.found(LandmarkQuery(bbox=BOX)).slots
    rows = [landmark_of(parsed(pb.AnsweredLandmark, one), of) for one in index.landmarks(slots)]
    assert rows == [row._replace(provenance="") for row in store.landmarks(LandmarkQuery(bbox=BOX))]


def test_a_place_that_is_free_again_is_taken_again() -> None:
    index = MemoryIndex()
    index.change([landmark("A", 0.0, 0.0), landmark("B", 1.0, 0.0)], ())
    index.change([landmark("C", 2.0, 0.0)], ["A", "nobody"])
    assert [index.name(slot) for slot in index.found(LandmarkQuery()).slots] == ["B", "C"]
    assert len(index) == 2

"""What every landmark store promises; each joins by a line in `KINDS` and one in `opened`."""

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest

from landmark_maps import examples
from landmark_maps.examples import SECOND_NS, START_NS, change, checkpoint, landmark
from trigpoint.errors import InputError
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.memory_store import MemoryStore
from trigpoint.landmarks.model import Anchor, Checkpoint, Landmark, LandmarkChanges
from trigpoint.landmarks.paging import LandmarkPage, page_of
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.landmarks.postgis_store import PostgisStore
from trigpoint.landmarks.queries import DegreeBox, Disc, LandmarkQuery, Nearest, PageMark, TimeSpan

StoreT = TypeVar("StoreT", bound=LandmarkStore)
EVERYWHERE = DegreeBox(lon_min_deg=-180.0, lat_min_deg=-90.0, lon_max_deg=180.0, lat_max_deg=90.0)
KINDS = ["memory", "geopackage", pytest.param("postgis", marks=pytest.mark.postgis)]


@contextmanager
def opened(request: pytest.FixtureRequest, folder: Path) -> Iterator[LandmarkStore]:
    """A new store of the kind that the fixture is asked for."""
    if request.param == "memory":
        yield MemoryStore()
    elif request.param == "geopackage":
        with closing(GeoPackageStore(folder / "map.gpkg")) as store:
            yield store
    else:
        cluster = request.getfixturevalue("postgis")
        with cluster.password_known(), closing(PostgisStore(cluster.url(cluster.created()))) as store:
            yield store


@pytest.fixture(params=KINDS)
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[LandmarkStore]:
    with opened(request, tmp_path) as store:
        yield store


@pytest.fixture
def moved(store: LandmarkStore) -> LandmarkStore:
    """Version 1 has A and B, version 2 has A as it was, B moved by 1 m, and C; version 3 has no A."""
    a, b, c = landmark("A", 0.0, 0.0), landmark("B", 100.0, 0.0), landmark("C", 0.0, 100.0, kind="corner")
    store.apply(change(1, opened=[a, b]), checkpoint(10))
    store.apply(change(2, opened=[landmark("B", 101.0, 0.0), c], closed=["B"]), checkpoint(20))
    store.apply(change(3, closed=["A"]), checkpoint(30))
    return store


def ids(landmarks: tuple[Landmark, ...]) -> list[str]:
    return [row.landmark for row in landmarks]


def box_of(x_min_m: float, y_min_m: float, x_max_m: float, y_max_m: float) -> DegreeBox:
    """A degree box through two corners given in the map frame."""
    low, high = landmark("low", x_min_m, y_min_m), landmark("high", x_max_m, y_max_m)
    return DegreeBox(
        lon_min_deg=low.lon_deg, lat_min_deg=low.lat_deg, lon_max_deg=high.lon_deg, lat_max_deg=high.lat_deg
    )


def test_a_new_store_is_empty(store: LandmarkStore) -> None:
    assert store.landmarks(LandmarkQuery()) == ()
    assert store.map_versions() == ()
    assert store.checkpoint() == Checkpoint()
    assert list(store.rows()) == []


def test_a_landmark_comes_back_exactly_as_it_was_applied(store: LandmarkStore) -> None:
    given = landmark("Pfahl 7/ü", 12.345678901234567, -0.1)
    store.apply(change(1, opened=[given]), checkpoint(1))
    assert store.landmarks(LandmarkQuery()) == (given,)


def test_a_version_comes_back_exactly_as_it_was_applied(store: LandmarkStore) -> None:
    applied = change(1, opened=[landmark("A", 0.0, 0.0)])
    store.apply(applied, checkpoint(1))
    assert store.map_versions() == (applied.version,)


def test_the_checkpoint_moves_with_the_version(moved: LandmarkStore) -> None:
    assert moved.checkpoint() == checkpoint(30)


def test_the_newest_version_is_answered_unless_another_is_asked_for(moved: LandmarkStore) -> None:
    assert ids(moved.landmarks(LandmarkQuery())) == ["B", "C"]


@pytest.mark.parametrize(("as_of", "expected"), [(1, ["A", "B"]), (2, ["A", "B", "C"]), (3, ["B", "C"])])
def test_every_version_is_kept(moved: LandmarkStore, as_of: int, expected: list[str]) -> None:
    assert ids(moved.landmarks(LandmarkQuery(as_of=as_of))) == expected


def test_an_older_version_has_the_older_position(moved: LandmarkStore) -> None:
    (old,) = [row for row in moved.landmarks(LandmarkQuery(as_of=1)) if row.landmark == "B"]
    assert (old.x_m, old.valid_from_version, old.valid_to_version) == (100.0, 1, 2)


def test_a_landmark_neither_opened_nor_closed_keeps_its_row(moved: LandmarkStore) -> None:
    (kept,) = [row for row in moved.landmarks(LandmarkQuery(as_of=2)) if row.landmark == "A"]
    assert (kept.valid_from_version, kept.valid_to_version) == (1, 3)


@pytest.mark.parametrize("as_of", [0, 4, -1])
def test_an_unknown_version_is_refused_with_the_known_ones(moved: LandmarkStore, as_of: int) -> None:
    with pytest.raises(InputError, match=f"map version {as_of} is unknown: 1 to 3 are there"):
        moved.landmarks(LandmarkQuery(as_of=as_of))


def test_any_version_of_an_empty_store_is_refused(store: LandmarkStore) -> None:
    with pytest.raises(InputError, match="map version 1 is unknown: no version is there yet"):
        store.landmarks(LandmarkQuery(as_of=1))


def test_a_bbox_finds_what_lies_in_it_and_nothing_else(moved: LandmarkStore) -> None:
    assert ids(moved.landmarks(LandmarkQuery(bbox=box_of(50.0, -20.0, 150.0, 20.0)))) == ["B"]


def test_a_bbox_holds_its_edges(moved: LandmarkStore) -> None:
    b = landmark("B", 101.0, 0.0)
    edge = DegreeBox(lon_min_deg=b.lon_deg, lat_min_deg=b.lat_deg, lon_max_deg=b.lon_deg, lat_max_deg=b.lat_deg)
    assert ids(moved.landmarks(LandmarkQuery(bbox=edge))) == ["B"]


def test_a_bbox_of_the_whole_earth_finds_everything(moved: LandmarkStore) -> None:
    assert ids(moved.landmarks(LandmarkQuery(bbox=EVERYWHERE))) == ["B", "C"]


def test_a_bbox_on_the_other_side_of_the_earth_finds_nothing(moved: LandmarkStore) -> None:
    elsewhere = DegreeBox(lon_min_deg=-30.0, lat_min_deg=30.0, lon_max_deg=-29.0, lat_max_deg=31.0)
    assert moved.landmarks(LandmarkQuery(bbox=elsewhere)) == ()


def test_a_bbox_asks_the_version_that_is_asked_for(moved: LandmarkStore) -> None:
    beside = box_of(99.5, -20.0, 100.5, 20.0)
    assert ids(moved.landmarks(LandmarkQuery(bbox=beside, as_of=1))) == ["B"]
    assert moved.landmarks(LandmarkQuery(bbox=beside)) == ()


def test_near_is_in_order_of_distance(store: LandmarkStore) -> None:
    store.apply(
        change(1, opened=[landmark("A", 30.0, 0.0), landmark("B", 0.0, 10.0), landmark("C", -20.0, 0.0)]), checkpoint(1)
    )
    here = landmark("here", 0.0, 0.0)
    found = store.landmarks(LandmarkQuery(near=Disc(lat_deg=here.lat_deg, lon_deg=here.lon_deg, radius_m=25.0)))
    assert ids(found) == ["B", "C"]


def test_the_radius_is_in_true_metres_not_in_metres_of_the_grid(store: LandmarkStore) -> None:
    # 300 km from the central meridian of zone 56 the grid is stretched by 507 ppm: 1000.0 grid m are 999.49 true m.
    store.apply(change(1, opened=[landmark("A", 469_000.0, 0.0)]), checkpoint(1))
    here = landmark("here", 468_000.0, 0.0)
    disc = Disc(lat_deg=here.lat_deg, lon_deg=here.lon_deg, radius_m=999.75)
    assert ids(store.landmarks(LandmarkQuery(near=disc))) == ["A"]


def test_a_limit_keeps_the_nearest(moved: LandmarkStore) -> None:
    here = landmark("here", 0.0, 90.0)
    disc = Disc(lat_deg=here.lat_deg, lon_deg=here.lon_deg, radius_m=500.0)
    assert ids(moved.landmarks(LandmarkQuery(near=disc, limit=1))) == ["C"]


def test_a_limit_without_an_area_keeps_the_first_ids(moved: LandmarkStore) -> None:
    assert ids(moved.landmarks(LandmarkQuery(as_of=2, limit=2))) == ["A", "B"]


def test_a_kind_is_asked_for_by_name(moved: LandmarkStore) -> None:
    assert ids(moved.landmarks(LandmarkQuery(kinds=("corner",)))) == ["C"]


def test_conditions_hold_together(moved: LandmarkStore) -> None:
    here = landmark("here", 0.0, 0.0)
    disc = Disc(lat_deg=here.lat_deg, lon_deg=here.lon_deg, radius_m=500.0)
    query = LandmarkQuery(bbox=box_of(-50.0, -50.0, 50.0, 150.0), near=disc, kinds=("pole",), as_of=2)
    assert ids(moved.landmarks(query)) == ["A"]


def test_changes_name_what_is_new_moved_and_gone(moved: LandmarkStore) -> None:
    changes = moved.changes(LandmarkQuery(), since=1)
    assert (ids(changes.changed), changes.removed, changes.as_of) == (["B", "C"], ("A",), 3)


def test_changes_up_to_a_version_stop_there(moved: LandmarkStore) -> None:
    changes = moved.changes(LandmarkQuery(as_of=2), since=1)
    assert (ids(changes.changed), changes.removed) == (["B", "C"], ())


def test_nothing_changed_since_the_newest_version(moved: LandmarkStore) -> None:
    assert moved.changes(LandmarkQuery(), since=3) == LandmarkChanges(since=3, as_of=3, changed=(), removed=())


def test_a_landmark_that_left_the_area_is_removed_from_it(moved: LandmarkStore) -> None:
    changes = moved.changes(LandmarkQuery(bbox=box_of(99.0, -20.0, 100.5, 20.0)), since=1)
    assert (changes.changed, changes.removed) == ((), ("B",))


def test_changes_since_an_unknown_version_are_refused(moved: LandmarkStore) -> None:
    with pytest.raises(InputError, match="map version 7 is unknown: 1 to 3 are there"):
        moved.changes(LandmarkQuery(), since=7)


def test_changes_with_a_limit_are_refused(moved: LandmarkStore) -> None:
    with pytest.raises(InputError, match="limit 5"):
        moved.changes(LandmarkQuery(limit=5), since=1)


@pytest.mark.parametrize("map_version", [3, 2])
def test_a_version_not_after_the_last_is_refused_and_changes_nothing(moved: LandmarkStore, map_version: int) -> None:
    before = set(moved.rows())
    with pytest.raises(InputError, match=f"map version {map_version}: 3 was already applied"):
        moved.apply(change(map_version, opened=[landmark("D", 0.0, 0.0)]), checkpoint(99))
    assert (set(moved.rows()), moved.checkpoint()) == (before, checkpoint(30))


def test_a_version_in_another_crs_is_refused_and_changes_nothing(moved: LandmarkStore) -> None:
    before = set(moved.rows())
    with pytest.raises(InputError, match="EPSG:32755.*the map is in EPSG:32756"):
        moved.apply(change(4, crs="EPSG:32755"), checkpoint(99))
    assert (set(moved.rows()), moved.checkpoint()) == (before, checkpoint(30))


def test_closing_what_is_not_valid_is_refused_and_changes_nothing(moved: LandmarkStore) -> None:
    before = set(moved.rows())
    with pytest.raises(InputError, match="map version 4 closes 2 landmarks: 1 are valid"):
        moved.apply(change(4, opened=[landmark("D", 0.0, 0.0)], closed=["B", "A"]), checkpoint(99))
    assert (set(moved.rows()), moved.checkpoint()) == (before, checkpoint(30))


def test_opening_what_is_still_valid_is_refused_and_changes_nothing(moved: LandmarkStore) -> None:
    before = set(moved.rows())
    with pytest.raises(InputError, match="map version 4 opens"):
        moved.apply(change(4, opened=[landmark("B", 0.0, 0.0)]), checkpoint(99))
    assert (set(moved.rows()), moved.checkpoint()) == (before, checkpoint(30))


def test_a_landmark_may_return_after_it_was_gone(moved: LandmarkStore) -> None:
    moved.apply(change(4, opened=[landmark("A", 0.0, 0.0)]), checkpoint(40))
    assert ids(moved.landmarks(LandmarkQuery(as_of=3))) == ["B", "C"]
    assert ids(moved.landmarks(LandmarkQuery(as_of=4))) == ["A", "B", "C"]


def test_rows_hold_every_version_of_every_landmark(moved: LandmarkStore) -> None:
    rows = [row for row in moved.rows() if isinstance(row, Landmark)]
    assert sorted((row.landmark, row.valid_from_version) for row in rows) == [("A", 1), ("B", 1), ("B", 2), ("C", 2)]


def test_trajectories_anchors_and_offsets_come_back_exactly(store: LandmarkStore) -> None:
    whole = examples.whole_change()
    store.apply(whole, checkpoint(1))
    expected = {
        whole.version,
        *whole.opened,
        *whole.trajectories,
        *whole.anchors,
        *whole.image_offsets,
        *whole.label_gains,
    }
    assert set(store.rows()) == expected


def test_a_landmark_s_history_is_every_row_it_has_had(moved: LandmarkStore) -> None:
    rows = moved.history("B")
    assert [(row.x_m, row.valid_from_version, row.valid_to_version) for row in rows] == [
        (100.0, 1, 2),
        (101.0, 2, None),
    ]
    assert [(row.valid_from_version, row.valid_to_version) for row in moved.history("A")] == [(1, 3)]


def test_a_landmark_the_map_never_had_has_no_history(moved: LandmarkStore) -> None:
    assert moved.history("Z") == ()


def test_an_empty_store_has_no_history(store: LandmarkStore) -> None:
    assert store.history("A") == ()


def test_one_name_in_two_images_is_two_anchors(store: LandmarkStore) -> None:
    whole = examples.whole_change()
    (tied, *_) = whole.anchors
    twins = (tied, replace(tied, image="tile-2", landmark=""))
    store.apply(replace(whole, anchors=twins), checkpoint(1))
    assert sorted((row.image, row.landmark) for row in store.rows() if isinstance(row, Anchor)) == [
        ("tile-1", "L1"),
        ("tile-2", ""),
    ]


@pytest.fixture
def applied_at_once(store: LandmarkStore) -> LandmarkStore:
    """The versions of `moved`, in one transaction."""
    a, b, c = landmark("A", 0.0, 0.0), landmark("B", 100.0, 0.0), landmark("C", 0.0, 100.0, kind="corner")
    versions = (
        change(1, opened=[a, b]),
        change(2, opened=[landmark("B", 101.0, 0.0), c], closed=["B"]),
        change(3, closed=["A"]),
    )
    store.apply_all(versions, checkpoint(30))
    return store


def test_versions_applied_at_once_are_as_if_applied_one_by_one(applied_at_once: LandmarkStore) -> None:
    one_by_one = MemoryStore()
    one_by_one.apply(change(1, opened=[landmark("A", 0.0, 0.0), landmark("B", 100.0, 0.0)]), checkpoint(10))
    moved_b, c = landmark("B", 101.0, 0.0), landmark("C", 0.0, 100.0, kind="corner")
    one_by_one.apply(change(2, opened=[moved_b, c], closed=["B"]), checkpoint(20))
    one_by_one.apply(change(3, closed=["A"]), checkpoint(30))
    assert set(applied_at_once.rows()) == set(one_by_one.rows())
    assert applied_at_once.checkpoint() == one_by_one.checkpoint()


@pytest.mark.parametrize("as_of", [1, 2, 3])
def test_every_version_applied_at_once_can_be_asked_for(applied_at_once: LandmarkStore, as_of: int) -> None:
    expected = {1: ["A", "B"], 2: ["A", "B", "C"], 3: ["B", "C"]}
    assert ids(applied_at_once.landmarks(LandmarkQuery(as_of=as_of))) == expected[as_of]


def test_of_versions_applied_at_once_all_or_none_are_there(moved: LandmarkStore) -> None:
    before = set(moved.rows())
    with pytest.raises(InputError, match="closes 1 landmarks: 0 are valid"):
        moved.apply_all((change(4, opened=[landmark("D", 0.0, 0.0)]), change(5, closed=["A"])), checkpoint(50))
    assert (set(moved.rows()), moved.checkpoint()) == (before, checkpoint(30))


def test_answers_are_the_same_while_indexes_are_put_off(moved: LandmarkStore) -> None:
    moved.defer_indexes()
    assert ids(moved.landmarks(LandmarkQuery(bbox=box_of(50.0, -20.0, 150.0, 20.0)))) == ["B"]
    moved.restore_indexes()
    assert ids(moved.landmarks(LandmarkQuery(bbox=box_of(50.0, -20.0, 150.0, 20.0)))) == ["B"]


def test_a_sound_store_has_no_damage(moved: LandmarkStore) -> None:
    assert moved.damage() == ()


@pytest.fixture(scope="module", params=KINDS)
def crowd(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[LandmarkStore, MemoryStore]]:
    """300 landmarks at random on 2 km, a third of them moved in version 2; and the same in memory. To be read only."""
    at_m = np.random.default_rng(5).uniform(-1000.0, 1000.0, (400, 2)).tolist()
    rows = [landmark(f"L{n}", *at_m[n], kind=("pole", "corner")[n % 2]) for n in range(300)]
    again = [landmark(f"L{3 * n}", *at_m[300 + n]) for n in range(100)]
    with opened(request, tmp_path_factory.mktemp("crowd")) as store:
        yield in_two_versions(store, rows, again), in_two_versions(MemoryStore(), rows, again)


def in_two_versions(store: StoreT, rows: Sequence[Landmark], again: Sequence[Landmark]) -> StoreT:
    """The store with the landmarks in its first version and some of them anew in its second."""
    store.apply(change(1, opened=rows), checkpoint(1))
    store.apply(change(2, opened=again, closed=[row.landmark for row in again]), checkpoint(2))
    return store


@pytest.mark.parametrize("as_of", [None, 1])
@pytest.mark.parametrize("kinds", [(), ("corner",)])
@pytest.mark.parametrize("limit", [None, 7])
@pytest.mark.parametrize("area", ["bbox", "near", "both"])
def test_every_store_answers_as_memory_does(
    crowd: tuple[LandmarkStore, MemoryStore], as_of: int | None, kinds: tuple[str, ...], limit: int | None, area: str
) -> None:
    here = landmark("here", 123.0, -45.0)
    query = LandmarkQuery(
        bbox=None if area == "near" else box_of(-300.0, -400.0, 500.0, 600.0),
        near=None if area == "bbox" else Disc(lat_deg=here.lat_deg, lon_deg=here.lon_deg, radius_m=350.0),
        kinds=kinds,
        as_of=as_of,
        limit=limit,
    )
    store, twin = crowd
    assert store.landmarks(query) == twin.landmarks(query) != ()


HERE = landmark("here", 123.0, -45.0)
NEAREST = Nearest(lat_deg=HERE.lat_deg, lon_deg=HERE.lon_deg, count=40)
AROUND = Disc(lat_deg=HERE.lat_deg, lon_deg=HERE.lon_deg, radius_m=350.0)
MORNING = TimeSpan(first_ns=START_NS + 100 * SECOND_NS, last_ns=START_NS + 200 * SECOND_NS)


def varied_rows() -> tuple[list[Landmark], list[Landmark]]:
    """200 landmarks of different certainty, vehicles and times, and a quarter of them moved."""
    numbers = np.random.default_rng(6)
    at_m = numbers.uniform(-1000.0, 1000.0, (250, 2)).tolist()
    rows = [
        landmark(f"L{n}", *at_m[n], kind=("pole", "corner", "")[n % 3])._replace(
            sigma_major_m=0.1 + 0.01 * (n % 20),
            vehicles=(("veh-a",), ('veh "b"',), ("veh-a", "ö, veh-c"), ())[n % 4],
            first_seen_ns=START_NS + n * SECOND_NS,
            last_seen_ns=START_NS + (n + n % 60) * SECOND_NS,
        )
        for n in range(200)
    ]
    again = [landmark(f"L{4 * n}", *at_m[200 + n])._replace(observation_count=99) for n in range(50)]
    return rows, again


@pytest.fixture(scope="module", params=KINDS)
def varied(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[LandmarkStore, MemoryStore]]:
    """The varied landmarks, moved in version 2; and the same in memory. To be read only."""
    with opened(request, tmp_path_factory.mktemp("varied")) as store:
        yield in_two_versions(store, *varied_rows()), in_two_versions(MemoryStore(), *varied_rows())


CONDITIONS = {
    "kinds": LandmarkQuery(kinds=("pole", "")),
    "certain": LandmarkQuery(max_sigma_m=0.15),
    "vehicle": LandmarkQuery(vehicle='veh "b"'),
    "vehicle limited": LandmarkQuery(vehicle="veh-a", limit=9),
    "seen": LandmarkQuery(seen=MORNING),
    "nearest": LandmarkQuery(nearest=NEAREST),
    "nearest of a kind": LandmarkQuery(nearest=NEAREST, kinds=("corner",), limit=7),
    "nearest in a box": LandmarkQuery(nearest=NEAREST, bbox=box_of(-300.0, -400.0, 500.0, 600.0)),
    "more than there are": LandmarkQuery(nearest=replace(NEAREST, count=1_000), max_sigma_m=0.12),
    "together": LandmarkQuery(near=AROUND, kinds=("pole",), max_sigma_m=0.25, vehicle="veh-a", seen=MORNING),
    "after an id": LandmarkQuery(after=PageMark(landmark="L17"), limit=30),
    "after an id in a box": LandmarkQuery(bbox=box_of(-900.0, -900.0, 500.0, 600.0), after=PageMark(landmark="L17")),
    "after a distance": LandmarkQuery(near=AROUND, after=PageMark(landmark="L0", distance_m=200.0)),
}


@pytest.mark.parametrize("as_of", [None, 1])
@pytest.mark.parametrize("name", CONDITIONS)
def test_every_store_answers_every_condition_as_memory_does(
    varied: tuple[LandmarkStore, MemoryStore], name: str, as_of: int | None
) -> None:
    store, twin = varied
    query = replace(CONDITIONS[name], as_of=as_of)
    assert store.landmarks(query) == twin.landmarks(query) != ()


@pytest.mark.parametrize("name", ["kinds", "certain", "vehicle", "seen", "together"])
def test_every_store_tells_changes_as_memory_does(varied: tuple[LandmarkStore, MemoryStore], name: str) -> None:
    store, twin = varied
    query = CONDITIONS[name]
    assert store.changes(query, since=1) == twin.changes(query, since=1)


def test_nearest_are_as_many_as_asked_for_in_order_of_distance(varied: tuple[LandmarkStore, MemoryStore]) -> None:
    found = varied[0].landmarks(LandmarkQuery(nearest=NEAREST, as_of=1))
    everything = varied[0].landmarks(LandmarkQuery(near=replace(AROUND, radius_m=5_000.0), as_of=1))
    assert (len(found), found) == (40, everything[:40])


def test_a_vehicle_whose_name_stands_inside_anothers_saw_nothing(varied: tuple[LandmarkStore, MemoryStore]) -> None:
    assert varied[0].landmarks(LandmarkQuery(vehicle="b")) == ()


def test_changes_backwards_are_refused(moved: LandmarkStore) -> None:
    with pytest.raises(InputError, match="changes since version 3 up to 2: the first has to be the older one"):
        moved.changes(LandmarkQuery(as_of=2), since=3)


def test_changes_among_the_nearest_are_refused(moved: LandmarkStore) -> None:
    with pytest.raises(InputError, match="nearest .* cannot go with changes since version 1"):
        moved.changes(LandmarkQuery(nearest=NEAREST), since=1)


def test_the_newest_version_is_known(moved: LandmarkStore) -> None:
    assert moved.newest_version() == moved.map_versions()[-1]


def test_an_empty_store_has_no_newest_version(store: LandmarkStore) -> None:
    assert store.newest_version() is None


def pages(store: LandmarkStore, query: LandmarkQuery) -> list[LandmarkPage]:
    """All pages of an answer."""
    found = [page_of(store, query)]
    while found[-1].next_page:
        found.append(page_of(store, query, token=found[-1].next_page))
    return found


@pytest.mark.parametrize("name", CONDITIONS)
def test_the_pages_of_an_answer_are_the_answer(varied: tuple[LandmarkStore, MemoryStore], name: str) -> None:
    query = replace(CONDITIONS[name], limit=None, after=None)
    whole = varied[0].landmarks(query)
    found = pages(varied[0], replace(query, limit=7))
    assert [row for page in found for row in page.landmarks] == list(whole)
    assert {len(page.landmarks) for page in found[:-1]} <= {7}


def test_pages_stay_in_the_version_of_the_first(store: LandmarkStore) -> None:
    query = LandmarkQuery(limit=150)
    first = page_of(in_two_versions(store, *varied_rows()), query)
    store.apply(change(3, closed=[row.landmark for row in store.landmarks(LandmarkQuery())]), checkpoint(3))
    second = page_of(store, query, token=first.next_page)
    assert (first.map_version, second.map_version, len(second.landmarks)) == (2, 2, 50)


def test_an_empty_store_has_one_empty_page_of_no_version(store: LandmarkStore) -> None:
    assert page_of(store, LandmarkQuery(limit=5)) == LandmarkPage(map_version=0, landmarks=(), next_page="")

"""What every source of features and tiles promises, on both databases; and that their answers are equal."""

import asyncio
import json
from collections.abc import Coroutine, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import pytest

from landmark_maps.examples import checkpoint
from map_features.examples import two_versions
from map_features.tile_reading import ReadFeature, read_tile
from trigpoint.errors import InputError
from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.web_tiles import WebTile, corner_of, tile_at
from trigpoint.landmarks.cql2_conditions import condition_from_text
from trigpoint.landmarks.feature_crs import CRS84, offered_crs, storage_crs
from trigpoint.landmarks.feature_query import (
    FeaturePage,
    FeatureQuery,
    FeatureSource,
    GridBox,
    MapState,
    VersionSummary,
)
from trigpoint.landmarks.geopackage_features import GeoPackageFeatures
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.layers import ANCHORS, IMAGE_OFFSETS, LANDMARKS, LAYERS, TRAJECTORIES, Layer
from trigpoint.landmarks.model import LabelGain
from trigpoint.landmarks.postgis_features import PostgisFeatures
from trigpoint.landmarks.postgis_store import PostgisStore
from trigpoint.landmarks.queries import DegreeBox, TimeSpan
from trigpoint.landmarks.tile_grid import buffered_box, require_tile

pytestmark = pytest.mark.postgis

Result = TypeVar("Result")
MIDDLE = Wgs84Position(-33.893, 151.184)
STORED = [layer for layer in LAYERS.values() if layer.stored]
TILED = [layer for layer in LAYERS.values() if layer.tiled]
FILTERS = (
    "kind = 'pole'",
    "kind LIKE 'a\\_b\\%c%'",
    "kind LIKE '%o%e'",
    "casei(kind) LIKE casei('CO%')",
    "casei(kind) = casei('CORNER')",
    "sigma_major_m < 0.5 AND anchored",
    "observation_count * 2 - 1 > 500",
    "NOT (kind IN ('pole', 'x'))",
    "valid_to_version IS NULL",
    "landmark > 'L2' AND landmark BETWEEN 'L3' AND 'Ä1'",
    "x_m / (y_m - y_m) > 1",
    "easting_m > 332500 OR northing_m < 6247500",
    "kind = 'pole' OR kind = 'Corner' AND anchored",
    "first_seen_ns >= 1700000100000000000",
    "S_INTERSECTS(geometry, POLYGON((151.18 -33.9,151.2 -33.9,151.2 -33.88,151.18 -33.88,151.18 -33.9)))",
    "S_DISJOINT(geometry, BBOX(151.18, -33.9, 151.19, -33.89))",
    "S_WITHIN(geometry, BBOX(151.18, -33.9, 151.19, -33.89)) AND kind = 'pole'",
)


@dataclass(frozen=True, slots=True)
class Stores:
    """Both databases with the same map in them."""

    geopackage: Path
    postgis_url: str


@pytest.fixture(scope="module")
def stores(postgis: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stores]:
    path = tmp_path_factory.mktemp("features") / "map.gpkg"
    with postgis.password_known():
        url = postgis.url(postgis.created())
        for store in (GeoPackageStore(path), PostgisStore(url)):
            with closing(store):
                for number, change in enumerate(two_versions()):
                    store.apply(change, checkpoint(number + 1))
        yield Stores(path, url)


@pytest.fixture
def runner() -> Iterator[asyncio.Runner]:
    with asyncio.Runner() as runner:
        yield runner


class Asked:
    """A source asked from outside of its event loop."""

    def __init__(self, source: FeatureSource, runner: asyncio.Runner) -> None:
        self._source, self._runner = source, runner
        self.map = self.state()

    def state(self) -> MapState:
        found = self._run(self._source.state(None))
        assert found is not None
        return found

    def page(self, layer: Layer = LANDMARKS, *, limit: int = 1000, **asked: Any) -> FeaturePage:
        return self._run(self._source.page(FeatureQuery(layer=layer, limit=limit, **asked), self.map))

    def features(self, layer: Layer = LANDMARKS, **asked: Any) -> list[Any]:
        found: list[Any] = json.loads(b"[" + self.page(layer, **asked).features + b"]")
        return found

    def tile(self, layer: Layer, tile: WebTile, *, as_of: int = 2) -> bytes:
        return self._run(self._source.tile(layer, tile, self.map, as_of=as_of))

    def history(self, limit: int = 10) -> tuple[VersionSummary, ...]:
        return self._run(self._source.history(limit))

    def settings_json(self, as_of: int) -> str:
        return self._run(self._source.settings_json(as_of))

    def label_gains(self, as_of: int) -> tuple[LabelGain, ...]:
        return self._run(self._source.label_gains(as_of))

    def _run(self, coroutine: Coroutine[Any, Any, Result]) -> Result:
        return self._runner.run(coroutine)


@pytest.fixture
def geopackage(stores: Stores, runner: asyncio.Runner) -> Iterator[Asked]:
    source = GeoPackageFeatures(stores.geopackage)
    yield Asked(source, runner)
    runner.run(source.close())


@pytest.fixture
def server(stores: Stores, runner: asyncio.Runner) -> Iterator[Asked]:
    source = PostgisFeatures(stores.postgis_url)
    yield Asked(source, runner)
    runner.run(source.close())


@pytest.fixture(params=["geopackage", "server"])
def source(request: pytest.FixtureRequest) -> Asked:
    found: Asked = request.getfixturevalue(request.param)
    return found


def named(feature: Any) -> str:
    return str(feature["id"])


def test_both_know_the_same_of_the_map(geopackage: Asked, server: Asked) -> None:
    assert geopackage.map == server.map
    assert (server.map.versions, server.map.crs) == ((1, 2), "EPSG:32756")


@pytest.mark.parametrize("layer", STORED, ids=lambda layer: layer.name)
@pytest.mark.parametrize("crs", offered_crs("EPSG:32756"), ids=lambda crs: crs.uri.rsplit("/", 1)[1])
@pytest.mark.parametrize("as_of", [1, 2])
def test_pages_are_equal(geopackage: Asked, server: Asked, layer: Layer, crs: Any, as_of: int) -> None:
    found = geopackage.features(layer, crs=crs, as_of=as_of)
    assert found == server.features(layer, crs=crs, as_of=as_of)
    assert len(found) == {"landmarks": 300, "trajectories": 2, "anchors": 3, "image_offsets": 1}[layer.name]


def test_both_tell_the_same_history(geopackage: Asked, server: Asked) -> None:
    found = geopackage.history()
    assert found == server.history()
    assert [(one.map_version, one.base_version) for one in found] == [(1, 0), (2, 1)]


def test_of_a_long_history_the_newest_versions_are_told(source: Asked) -> None:
    assert [one.map_version for one in source.history(1)] == [2]


def test_a_version_s_settings_are_told(source: Asked) -> None:
    assert source.settings_json(2) == "{}"


@pytest.mark.parametrize("as_of", [1, 2])
def test_what_a_label_would_tell_is_the_newest_whole_version_s(geopackage: Asked, server: Asked, as_of: int) -> None:
    found = geopackage.label_gains(as_of)
    assert found == server.label_gains(as_of) == (*two_versions()[0].label_gains,)


@pytest.mark.parametrize("text", FILTERS)
def test_filters_are_met_by_the_same_features(geopackage: Asked, server: Asked, text: str) -> None:
    condition = condition_from_text(text, LANDMARKS)
    found = geopackage.features(condition=condition)
    assert found == server.features(condition=condition)
    assert (text.startswith("x_m /")) == (found == [])


@pytest.mark.parametrize("zoom", [3, 10, 13, 15, 17])
@pytest.mark.parametrize("layer", TILED, ids=lambda layer: layer.name)
@pytest.mark.parametrize("as_of", [1, 2])
def test_tiles_are_equal_feature_for_feature(
    geopackage: Asked, server: Asked, layer: Layer, zoom: int, as_of: int, tmp_path: Path
) -> None:
    tile = tile_at(MIDDLE, zoom)
    drawn = [read_tile(one.tile(layer, tile, as_of=as_of), layer.name, tmp_path) for one in (geopackage, server)]
    first, second = (sorted(one, key=_properties_of) for one in drawn)
    assert list(map(_properties_of, first)) == list(map(_properties_of, second))
    apart = [a.geometry.hausdorff_distance(b.geometry) for a, b in zip(first, second, strict=True)]
    # Points are on the same unit; of a line PostGIS may leave out a place within a unit of its neighbours.
    assert max(apart, default=0.0) <= (1.0 if layer is TRAJECTORIES else 0.0)


def _properties_of(feature: ReadFeature) -> str:
    return json.dumps({name: str(value) for name, value in sorted(feature.properties.items())})


def test_the_newest_version_is_shown_unless_another_is_asked_for(source: Asked) -> None:
    assert source.features() == source.features(as_of=2) != source.features(as_of=1)
    assert source.features(TRAJECTORIES) == source.features(TRAJECTORIES, as_of=2)
    assert (source.page().map_version, source.page(as_of=1).map_version) == (2, 1)


def test_a_box_of_degrees_holds_its_edges_and_nothing_else(source: Asked) -> None:
    (one,) = source.features(feature_id="L1")
    lon_deg, lat_deg = one["geometry"]["coordinates"]
    margin_deg = 1e-8
    around = DegreeBox(
        lon_min_deg=lon_deg - margin_deg,
        lat_min_deg=lat_deg - margin_deg,
        lon_max_deg=lon_deg + margin_deg,
        lat_max_deg=lat_deg + margin_deg,
    )
    assert list(map(named, source.features(areas=(around,)))) == ["L1"]


def test_one_of_several_areas_is_enough(source: Asked) -> None:
    west = DegreeBox(lon_min_deg=170.0, lat_min_deg=-40.0, lon_max_deg=180.0, lat_max_deg=0.0)
    here = DegreeBox(lon_min_deg=151.17, lat_min_deg=-33.9, lon_max_deg=151.18, lat_max_deg=-33.89)
    assert source.features(areas=(west, here)) == source.features(areas=(here,)) != []
    assert source.features(areas=(west,)) == []


@pytest.mark.parametrize("layer", [LANDMARKS, TRAJECTORIES], ids=lambda layer: layer.name)
def test_a_box_on_the_grid_finds_what_lies_in_it(source: Asked, layer: Layer) -> None:
    box = GridBox(
        easting_min_m=332_000.0, northing_min_m=6_248_000.0, easting_max_m=332_300.0, northing_max_m=6_248_230.0
    )
    found = source.features(layer, areas=(box,), crs=storage_crs(source.map.crs), as_of=2)
    points = [place for one in found for place in _places(one)]
    assert found
    assert layer is TRAJECTORIES or all(
        332_000.0 <= east <= 332_300.0 and 6_248_000.0 <= north <= 6_248_230.0 for east, north in points
    )


def _places(feature: Any) -> list[Any]:
    geometry = feature["geometry"]
    return [geometry["coordinates"]] if geometry["type"] == "Point" else list(geometry["coordinates"])


def test_an_area_finds_nothing_without_geometry(source: Asked) -> None:
    everywhere = DegreeBox(lon_min_deg=-180.0, lat_min_deg=-90.0, lon_max_deg=180.0, lat_max_deg=90.0)
    assert source.features(IMAGE_OFFSETS, areas=(everywhere,), as_of=2) == []
    assert list(map(named, source.features(ANCHORS, areas=(everywhere,), as_of=2))) == ["a/2", "a1@tile-1"]


def test_a_span_finds_what_was_seen_in_it(source: Asked) -> None:
    row = source.features(feature_id="L1")[0]["properties"]
    before = TimeSpan(first_ns=0, last_ns=row["first_seen_ns"])
    assert "L1" in map(named, source.features(during=before, as_of=1))
    assert source.features(during=TimeSpan(first_ns=0, last_ns=1)) == []


def test_pages_hold_every_feature_once_in_order(source: Asked) -> None:
    seen: list[str] = []
    first_id: str | None = None
    while first_id is not None or not seen:
        page = source.page(limit=70, first_id=first_id, as_of=1)
        seen += map(named, json.loads(b"[" + page.features + b"]"))
        assert page.count <= 70
        first_id = page.next_id
    assert seen == sorted(set(seen))
    assert len(seen) == 300


def test_a_page_as_long_as_the_answer_is_the_last(source: Asked) -> None:
    assert source.page(limit=300).next_id is None
    assert source.page(limit=299).count == 299


def test_an_empty_tile_is_no_bytes(source: Asked) -> None:
    assert source.tile(LANDMARKS, WebTile(12, 0, 0)) == b""


def test_the_tile_of_the_whole_world_says_how_many_are_left_out(source: Asked, tmp_path: Path) -> None:
    (one,) = read_tile(source.tile(LANDMARKS, WebTile(0, 0, 0)), "landmarks", tmp_path)
    assert one.properties["left_out"] == 299


def test_beyond_the_crowd_every_landmark_is_in_its_tile(source: Asked, tmp_path: Path) -> None:
    tile = tile_at(MIDDLE, 15)
    drawn = {one.properties["landmark"] for one in read_tile(source.tile(LANDMARKS, tile), "landmarks", tmp_path)}
    (west, north), (east, south) = corner_of(15, tile.column, tile.row), corner_of(15, tile.column + 1, tile.row + 1)
    own = DegreeBox(lon_min_deg=west, lat_min_deg=south, lon_max_deg=east, lat_max_deg=north)
    assert set(map(named, source.features(areas=(own,)))) <= drawn
    assert drawn <= set(map(named, source.features(areas=(buffered_box(tile),))))


def test_a_landmark_by_an_edge_is_in_both_tiles(source: Asked, tmp_path: Path) -> None:
    left = WebTile(15, 30144, 19666)
    right = WebTile(left.zoom, left.column + 1, left.row)
    units = [
        {
            one.properties["landmark"]: one.geometry.x
            for one in read_tile(source.tile(LANDMARKS, tile), "landmarks", tmp_path)
        }
        for tile in (left, right)
    ]
    shared = units[0].keys() & units[1].keys()
    assert shared
    assert {name: units[0][name] - 4096 for name in shared} == {name: units[1][name] for name in shared}


def test_a_value_no_database_holds_is_refused(source: Asked) -> None:
    condition = condition_from_text("x_m * 1e300 * 1e300 > 1", LANDMARKS)
    with pytest.raises(InputError, match="out of range"):
        source.page(condition=condition)


def test_what_is_known_of_an_unchanged_map_is_not_asked_for_again(source: Asked) -> None:
    known = source.map
    assert source._run(source._source.state(known)) is known


def test_the_tile_grid_refuses_a_tile_that_is_not_there() -> None:
    with pytest.raises(InputError, match="outside 0 to 3"):
        require_tile(2, 4, 0)
    with pytest.raises(InputError, match="zoom 25"):
        require_tile(25, 0, 0)


def test_degrees_in_the_common_order_are_the_default() -> None:
    assert FeatureQuery(layer=LANDMARKS, limit=1).crs is CRS84

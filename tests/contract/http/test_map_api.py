"""What the HTTP service answers, the same from both databases."""

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest

from landmark_maps.examples import CRS
from map_features.examples import two_versions
from map_features.tile_reading import read_tile
from map_http.asking import Api, asked_api, problem
from map_http.corrections import MemoryCorrections
from map_http.sources import filled_source
from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.web_tiles import tile_at

CRS84 = "http://www.opengis.net/def/crs/OGC/1.3/CRS84"
EPSG = "http://www.opengis.net/def/crs/EPSG/0/"
AS_IT_IS = {"Accept-Encoding": "identity"}
ITEMS = "/collections/landmarks/items"
SYDNEY = tile_at(Wgs84Position(-33.893, 151.184), 15)
TILE = f"/tiles/landmarks/15/{SYDNEY.column}/{SYDNEY.row}"


@pytest.fixture(scope="module", params=["geopackage", pytest.param("postgis", marks=pytest.mark.postgis)])
def api(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    with pytest.MonkeyPatch.context() as patch, asyncio.Runner() as runner:
        source = filled_source(request, tmp_path_factory.mktemp("api"), patch, two_versions())
        with asked_api(source, runner, corrections=MemoryCorrections()) as found:
            yield found


def test_the_landing_page_leads_everywhere(api: Api) -> None:
    links = api.told("/")["links"]
    assert {"self", "service-desc", "conformance", "data"} <= {one["rel"] for one in links}
    own = [one["href"] for one in links if one["rel"] != "alternate"]
    assert [api.get(href).status_code for href in own] == [200] * len(own)


def test_people_get_a_page_of_links(api: Api) -> None:
    page = api.get("/", headers={"Accept": "text/html,*/*"})
    assert page.headers["content-type"].startswith("text/html")
    assert 'href="http://127.0.0.1:8080/collections"' in page.text


def test_every_collection_names_its_reference_systems(api: Api) -> None:
    collections = api.told("/collections")["collections"]
    assert [one["id"] for one in collections] == ["landmarks", "trajectories", "anchors", "drives", "image_offsets"]
    assert {one["storageCrs"] for one in collections} == {f"{EPSG}{CRS.removeprefix('EPSG:')}"}
    assert all({CRS84, f"{EPSG}4326", f"{EPSG}3857", f"{EPSG}32756"} == set(one["crs"]) for one in collections)


def test_a_collection_has_the_links_clients_look_for(api: Api) -> None:
    links = api.told("/collections/landmarks")["links"]
    assert {"self", "items"} <= {one["rel"] for one in links}
    assert [api.get(one["href"]).status_code for one in links] == [200] * len(links)


def test_a_collection_says_where_and_when(api: Api) -> None:
    extent = api.told("/collections/landmarks")["extent"]
    west, south, east, north = extent["spatial"]["bbox"][0]
    assert 151.17 < west < east < 151.20
    assert -33.91 < south < north < -33.88
    assert extent["temporal"]["interval"][0][0].startswith("2023-11-14T22:13:2")


def test_an_unknown_collection_is_a_problem(api: Api) -> None:
    assert problem(api.get("/collections/nothing"))["status"] == 404
    assert problem(api.get("/collections/nothing/items"))["status"] == 404


def test_a_page_has_the_version_counts_and_links(api: Api) -> None:
    page = api.told(ITEMS, limit=10)
    assert (page["map_version"], page["numberReturned"], len(page["features"])) == (2, 10, 10)
    assert {"self", "alternate", "collection", "next"} == {one["rel"] for one in page["links"]}


def test_pages_lead_to_every_feature_of_one_version(api: Api) -> None:
    seen: list[str] = []
    following = f"{ITEMS}?limit=110"
    while following:
        page = api.told(following)
        seen += [feature["id"] for feature in page["features"]]
        following = next((one["href"] for one in page["links"] if one["rel"] == "next"), "")
        assert not following or parse_qs(urlsplit(following).query)["as_of"] == ["2"]
    assert len(seen) == len(set(seen)) == 300


def test_the_whole_answer_on_one_page_says_how_many_match(api: Api) -> None:
    page = api.told(ITEMS, limit=10_000)
    assert page["numberMatched"] == page["numberReturned"] == 300


def test_a_limit_beyond_the_most_is_the_most(api: Api) -> None:
    assert api.get(ITEMS, params={"limit": 20_000}).status_code == 200


def test_coordinates_are_longitude_and_latitude_unless_asked_otherwise(api: Api) -> None:
    answer = api.get(f"{ITEMS}/L1")
    lon_deg, lat_deg = answer.json()["geometry"]["coordinates"]
    assert (151.0 < lon_deg < 152.0, -34.0 < lat_deg < -33.0) == (True, True)
    assert answer.headers["content-crs"] == f"<{CRS84}>"


def test_epsg_4326_has_latitude_first(api: Api) -> None:
    answer = api.get(f"{ITEMS}/L1", params={"crs": f"{EPSG}4326"})
    lon_deg, lat_deg = api.told(f"{ITEMS}/L1")["geometry"]["coordinates"]
    assert answer.json()["geometry"]["coordinates"] == [lat_deg, lon_deg]
    assert answer.headers["content-crs"] == f"<{EPSG}4326>"


def test_the_map_s_own_system_is_its_grid(api: Api) -> None:
    feature = api.told(f"{ITEMS}/L1", crs=f"{EPSG}32756")
    properties = feature["properties"]
    assert feature["geometry"]["coordinates"] == [properties["easting_m"], properties["northing_m"]]


def test_an_unknown_system_is_refused_with_those_there_are(api: Api) -> None:
    assert "EPSG/0/32756" in problem(api.get(ITEMS, params={"crs": f"{EPSG}2154"}))["detail"]


def test_a_box_may_be_in_any_offered_system(api: Api) -> None:
    lon_deg, lat_deg = api.told(f"{ITEMS}/L1")["geometry"]["coordinates"]
    east_m, north_m = api.told(f"{ITEMS}/L1", crs=f"{EPSG}32756")["geometry"]["coordinates"]
    x_m, y_m = api.told(f"{ITEMS}/L1", crs=f"{EPSG}3857")["geometry"]["coordinates"]
    found = [
        api.ids(ITEMS, bbox=around(lon_deg, lat_deg, 1e-7)),
        api.ids(ITEMS, bbox=around(lat_deg, lon_deg, 1e-7), **{"bbox-crs": f"{EPSG}4326"}),
        api.ids(ITEMS, bbox=around(east_m, north_m, 0.01), **{"bbox-crs": f"{EPSG}32756"}),
        api.ids(ITEMS, bbox=around(x_m, y_m, 0.01), **{"bbox-crs": f"{EPSG}3857"}),
    ]
    assert found == [["L1"]] * 4


def around(first: float, second: float, margin: float) -> str:
    return f"{first - margin:.9f},{second - margin:.9f},{first + margin:.9f},{second + margin:.9f}"


def test_a_box_with_heights_is_taken_flat(api: Api) -> None:
    flat, high = "151.17,-33.9,151.18,-33.89", "151.17,-33.9,-5,151.18,-33.89,5"
    assert api.ids(ITEMS, bbox=flat) == api.ids(ITEMS, bbox=high) != []


def test_a_box_across_the_antimeridian_reaches_around(api: Api) -> None:
    assert api.ids(ITEMS, bbox="151,-34,-170,-33", limit=1000) == api.ids(ITEMS, limit=1000)
    assert api.ids(ITEMS, bbox="170,-34,-170,-33") == []


def test_a_moment_finds_what_was_seen_then(api: Api) -> None:
    early = api.ids(ITEMS, datetime="../2023-11-14T22:13:20Z", as_of=1)
    assert early == ["Ä0"]
    assert api.ids(ITEMS, datetime="2023-11-14", limit=1000) == api.ids(ITEMS, limit=1000)
    assert api.ids(ITEMS, datetime="2030-01-01T00:00:00Z/..") == []


def test_an_older_version_can_be_asked_for(api: Api) -> None:
    before, now = (api.told(f"{ITEMS}/Ä0", as_of=version)["properties"]["y_m"] for version in (1, 2))
    assert now - before == pytest.approx(10.0, abs=1e-3)


@pytest.mark.parametrize("path", [ITEMS, f"{ITEMS}/L1", TILE, "/tiles/landmarks.json"])
def test_a_version_that_is_not_there_is_not_found(api: Api, path: str) -> None:
    assert "map version 9 is unknown: 1 to 2 are there" in problem(api.get(path, params={"as_of": 9}))["detail"]


def test_a_property_is_asked_for_by_its_name(api: Api) -> None:
    poles = api.ids(ITEMS, kind="pole", limit=1000)
    assert poles == api.ids(ITEMS, filter="kind = 'pole'", limit=1000)
    assert len(poles) == 100
    assert len(api.ids(ITEMS, anchored="true", kind="pole", limit=1000, as_of=1)) == 20


def test_cql2_in_json_means_the_same(api: Api) -> None:
    tree = {"op": "and", "args": [{"op": "=", "args": [{"property": "kind"}, "pole"]}, {"property": "anchored"}]}
    found = api.ids(ITEMS, filter=json.dumps(tree), limit=1000, **{"filter-lang": "cql2-json"})
    assert found == api.ids(ITEMS, filter="kind = 'pole' AND anchored = TRUE", limit=1000) != []


def test_a_filter_s_geometry_may_be_in_another_system(api: Api) -> None:
    box = "332000,6248000,332300,6248300"
    on_grid = f"S_INTERSECTS(geometry, BBOX({box}))"
    found = api.ids(ITEMS, filter=on_grid, limit=1000, **{"filter-crs": f"{EPSG}32756"})
    corners = set(api.ids(ITEMS, bbox=box, limit=1000, **{"bbox-crs": f"{EPSG}32756"}))
    # Edges straight in degrees bend on the grid, by under a millimetre over 300 m: no landmark is that near to one.
    assert set(found) == corners != set()


def test_other_layers_are_collections_too(api: Api) -> None:
    (a, b) = api.told("/collections/trajectories/items")["features"]
    assert (a["id"], b["id"], b["properties"]["map_version"]) == ("veh-a:boot-1", "veh-b:boot-1", 2)
    assert a["geometry"]["type"] == "LineString"
    assert api.ids("/collections/anchors/items") == ["a/2", "a1@tile-1", "a3@tile-1"]
    assert api.told("/collections/image_offsets/items/tile-1")["properties"]["offset_x_m"] == 0.25
    assert api.told("/collections/anchors/items/a%2F2")["properties"]["anchor"] == "a/2"


def test_drives_come_from_the_log(api: Api) -> None:
    assert api.ids("/collections/drives/items") == ["veh-a:b1", "veh-a:b2", "veh-b:b1"]
    assert api.ids("/collections/drives/items", excluded="true") == ["veh-a:b2"]
    assert api.ids("/collections/drives/items", filter="vehicle = 'veh-a' AND author IS NULL") == ["veh-a:b1"]
    assert api.told("/collections/drives/items/veh-a:b2")["properties"]["reason"] == "fog"
    assert problem(api.get("/collections/drives/items/veh-z:b1"))["status"] == 404


def test_an_unknown_feature_is_not_found(api: Api) -> None:
    assert problem(api.get(f"{ITEMS}/L999"))["status"] == 404


def test_a_tile_is_named_by_layer_place_and_version(api: Api, tmp_path: Path) -> None:
    tile = api.get(TILE, headers=AS_IT_IS)
    assert tile.headers["content-type"] == "application/vnd.mapbox-vector-tile"
    assert tile.headers["etag"] == f'"1-landmarks-15-{SYDNEY.column}-{SYDNEY.row}-2"'
    assert "must-revalidate" in tile.headers["cache-control"]
    assert len(read_tile(tile.content, "landmarks", tmp_path)) > 50


def test_the_same_tile_is_at_every_address(api: Api) -> None:
    ogc = f"/collections/landmarks/tiles/WebMercatorQuad/15/{SYDNEY.row}/{SYDNEY.column}"
    paths = (TILE, f"{TILE}.mvt", f"{TILE}?as_of=2", f"{TILE}?version=2", f"/v/2{TILE}", ogc)
    assert len({api.get(path).content for path in paths}) == 1


@pytest.mark.parametrize("path", [f"{TILE}?as_of=1", f"{TILE}?version=1", f"/v/1{TILE}"])
def test_a_versioned_tile_never_changes(api: Api, path: str) -> None:
    tile = api.get(path, headers=AS_IT_IS)
    assert "immutable" in tile.headers["cache-control"]
    assert tile.headers["etag"].endswith('-1"')
    assert tile.content != api.get(TILE).content


@pytest.mark.parametrize("held", ['"{own}"', 'W/"{own}"', '"other", "{own}"', "*"])
def test_a_tile_a_client_has_is_not_sent_again(api: Api, held: str) -> None:
    own = api.get(TILE).headers["etag"].strip('"')
    answer = api.get(TILE, headers={"If-None-Match": held.replace("{own}", own)})
    assert (answer.status_code, answer.content, answer.headers["etag"]) == (304, b"", f'"{own}"')


def test_an_empty_tile_has_no_content(api: Api) -> None:
    answer = api.get("/tiles/landmarks/5/0/0")
    assert (answer.status_code, answer.content) == (204, b"")
    assert "etag" in answer.headers


@pytest.mark.parametrize("place", ["25/0/0", "2/4/0", "2/0/4", "-1/0/0", "a/0/0", "1.5/0/0", "2/0/00", "2/0/0.png"])
def test_a_tile_that_is_none_is_not_found(api: Api, place: str) -> None:
    assert problem(api.get(f"/tiles/landmarks/{place}"))["status"] == 404


@pytest.mark.parametrize("name", ["drives", "image_offsets", "nothing"])
def test_a_layer_without_tiles_is_not_found(api: Api, name: str) -> None:
    assert problem(api.get(f"/tiles/{name}/0/0/0"))["status"] == 404
    assert problem(api.get(f"/tiles/{name}.json"))["status"] == 404


def test_tilejson_leads_to_tiles(api: Api) -> None:
    described = api.told("/tiles/landmarks.json")
    place = described["tiles"][0].format(z=15, x=SYDNEY.column, y=SYDNEY.row)
    assert api.get(place).content == api.get(TILE).content
    assert described["vector_layers"][0]["id"] == "landmarks"
    assert api.told("/tiles/landmarks.json", as_of=1)["tiles"][0].startswith("http://127.0.0.1:8080/v/1/tiles/")


def test_the_tile_set_s_links_lead_on(api: Api) -> None:
    (one,) = api.told("/collections/landmarks/tiles")["tilesets"]
    (item,) = [link["href"] for link in one["links"] if link["rel"] == "item"]
    place = item.format(tileMatrix=15, tileRow=SYDNEY.row, tileCol=SYDNEY.column)
    assert api.get(place).content == api.get(TILE).content
    assert api.told("/collections/landmarks/tiles/WebMercatorQuad")["tileMatrixSetURI"].endswith("WebMercatorQuad")
    assert len(api.told("/tileMatrixSets/WebMercatorQuad")["tileMatrices"]) == 25


def test_all_versions_are_told(api: Api) -> None:
    assert api.told("/versions")["versions"] == [1, 2]


def test_head_is_answered_like_get(api: Api) -> None:
    assert api.ask("HEAD", ITEMS).status_code == 200
    assert api.ask("HEAD", "/").status_code == 200

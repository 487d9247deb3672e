"""Tiles and pages in gzip for those who ask for it, and named apart from what others get."""

import asyncio
from collections.abc import Iterator
from contextlib import closing

import pytest

from landmark_maps.examples import checkpoint
from map_features.examples import two_versions
from map_http.asking import Api, asked_api
from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.web_tiles import tile_at
from trigpoint.landmarks.geopackage_features import GeoPackageFeatures
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint_landmarks.http.compression import accepts_gzip

SYDNEY = tile_at(Wgs84Position(-33.893, 151.184), 15)
TILE = f"/tiles/landmarks/15/{SYDNEY.column}/{SYDNEY.row}"
ITEMS = "/collections/landmarks/items"
PLAIN, GZIP = {"Accept-Encoding": "identity"}, {"Accept-Encoding": "gzip"}


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    path = tmp_path_factory.mktemp("compressed") / "map.gpkg"
    with closing(GeoPackageStore(path)) as store:
        for number, change in enumerate(two_versions()):
            store.apply(change, checkpoint(number + 1))
    with asyncio.Runner() as runner, asked_api(GeoPackageFeatures(path), runner) as found:
        yield found


@pytest.mark.parametrize("path", [TILE, ITEMS])
def test_the_content_is_the_same_compressed_and_as_it_is(api: Api, path: str) -> None:
    plain, packed = api.get(path, headers=PLAIN), api.get(path, headers=GZIP)
    assert (plain.headers.get("content-encoding"), packed.headers.get("content-encoding")) == (None, "gzip")
    assert packed.content == plain.content  # the client unpacks
    assert int(packed.headers["content-length"]) < len(plain.content) / 2


@pytest.mark.parametrize("path", [TILE, ITEMS, "/tiles/landmarks/5/0/0"])
@pytest.mark.parametrize("headers", [PLAIN, GZIP])
def test_every_answer_says_what_it_depends_on(api: Api, path: str, headers: dict[str, str]) -> None:
    assert "Accept-Encoding" in api.get(path, headers=headers).headers["vary"]


def test_a_tile_has_another_strong_name_in_each_encoding(api: Api) -> None:
    plain, packed = (api.get(TILE, headers=headers).headers["etag"] for headers in (PLAIN, GZIP))
    assert plain != packed
    assert plain.startswith('"')
    assert packed.startswith('"')


@pytest.mark.parametrize("headers", [PLAIN, GZIP])
def test_a_tile_held_in_an_encoding_is_not_sent_again_in_it(api: Api, headers: dict[str, str]) -> None:
    held = api.get(TILE, headers=headers).headers["etag"]
    again = api.get(TILE, headers={**headers, "If-None-Match": held})
    assert (again.status_code, again.headers["etag"]) == (304, held)


def test_a_tile_held_in_one_encoding_is_sent_in_the_other(api: Api) -> None:
    held = api.get(TILE, headers=PLAIN).headers["etag"]
    assert api.get(TILE, headers={**GZIP, "If-None-Match": held}).status_code == 200


def test_a_page_that_fits_a_packet_is_left_as_it_is(api: Api) -> None:
    page = api.get(ITEMS, headers=GZIP, params={"limit": 1, "bbox": "0,0,1,1"})
    assert "content-encoding" not in page.headers


@pytest.mark.parametrize("accepted", ["gzip", "deflate, GZIP;q=0.5", "*", "br, *;q=0.1", "gzip; q=1.000"])
def test_gzip_is_asked_for(accepted: str) -> None:
    assert accepts_gzip(accepted)


@pytest.mark.parametrize("accepted", ["", "identity", "br, deflate", "gzip;q=0", "gzip; q=0.000, *", "*;q=0"])
def test_gzip_is_not_asked_for(accepted: str) -> None:
    assert not accepts_gzip(accepted)

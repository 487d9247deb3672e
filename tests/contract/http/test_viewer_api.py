"""What a viewer asks beside features and tiles, the same from both databases."""

import asyncio
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from shapely.geometry import Point, shape

from map_features.anchored import OFFSET_M, PLACES_M, anchored_version, degrees
from map_http.asking import Api, asked_api, problem
from map_http.corrections import MemoryCorrections
from map_http.measured import FIXES, STEPS, MemoryDrives
from map_http.sources import filled_source
from registered_images.examples import registered, tile
from trigpoint.errors import InputError
from trigpoint.landmarks.model import MapChange
from trigpoint_landmarks.http.ports import NewLabel
from trigpoint_landmarks.http.settings import RasterSettings, WebSettings
from trigpoint_tiles.core.check_layer import check_layer

PIXEL = b"\x89PNG of the ground"


@pytest.fixture(scope="module", params=["geopackage", pytest.param("postgis", marks=pytest.mark.postgis)])
def api(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    folder = tmp_path_factory.mktemp("viewer")
    with pytest.MonkeyPatch.context() as patch, asyncio.Runner() as runner:
        source = filled_source(request, folder, patch, [anchored_version(1, tied=False), second_version()])
        settings = WebSettings(rasters=(raster(folder),))
        corrections, drives, made = MemoryCorrections(), MemoryDrives(), shifts(folder)
        with asked_api(source, runner, settings, corrections=corrections, drives=drives, shifts=made) as found:
            yield found


def second_version() -> MapChange:
    return replace(anchored_version(2), closed=tuple(PLACES_M))


def raster(folder: Path) -> RasterSettings:
    tiles = folder / "aerial"
    (tiles / "3" / "7").mkdir(parents=True)
    (tiles / "3" / "7" / "4.png").write_bytes(PIXEL)
    (folder / "secret.png").write_bytes(b"not to be seen")
    (tiles / "3" / "7" / "5.png").symlink_to(folder / "secret.png")
    return RasterSettings(name="air", folder=tiles, bounds=(151.0, -34.0, 151.5, -33.5), images=("tile-1",), maxzoom=9)


def shifts(folder: Path) -> Path:
    made = folder / "shifts"
    made.mkdir()
    layer = check_layer(registered(tile(0, (0.3, 0.4)), tile(1, (0.0, 0.0), refused="dark")), image="north 1")
    (made / "north 1.geojson").write_text(layer, encoding="utf-8")
    (folder / "secret.geojson").write_text("not to be seen", encoding="utf-8")
    (made / "secret.geojson").symlink_to(folder / "secret.geojson")
    return made


def label_at(x_m: float, y_m: float, **more: object) -> dict[str, object]:
    lat_deg, lon_deg = degrees(x_m, y_m)
    return {"lat_deg": lat_deg, "lon_deg": lon_deg, "image_sigma_m": 0.0, **more}


def test_a_label_beside_a_landmark_would_be_tied_to_it(api: Api) -> None:
    found = api.told("/association", **label_at(20.3, 0.0, image="new", image_sigma_m=0.35))
    assert (found["landmark"], found["reason"], found["map_version"]) == ("", found["reason"], 2)
    assert found["reason"] == "another label is nearer to the landmark"  # a0 lies on it
    free = api.told("/association", **label_at(-0.5, 0.0))
    assert (free["landmark"], free["reason"]) == ("L0", "")
    assert free["distance_m"] == pytest.approx(0.5, abs=1e-3)  # m: the features' coordinates are rounded
    assert free["gate_m"] == pytest.approx(3.5 * math.sqrt(0.09 + 0.01), abs=1e-6)  # L0's larger variance, the label's
    assert free["chi_square"] == pytest.approx((0.5 / math.sqrt(0.1)) ** 2, abs=0.02)
    assert free["chi_square_limit"] == pytest.approx(3.5**2)
    assert (free["runner_up"]["landmark"], free["runner_up"]["distance_m"]) == ("L1", pytest.approx(1.7, abs=1e-3))
    assert "L0" in free["explanation"]


def test_a_label_between_two_landmarks_would_be_of_neither(api: Api) -> None:
    found = api.told("/association", **label_at(0.55, 0.0))
    assert (found["landmark"], found["reason"]) == ("", "two landmarks 0.55 m and 0.65 m away")
    assert found["landmark_kind"] == "pole"


def test_a_label_far_from_all_says_how_far_and_the_gate(api: Api) -> None:
    found = api.told("/association", **label_at(0.0, 300.0))
    assert found["reason"].startswith("nearest landmark 27")  # L4, 272.9 m away
    assert found["landmark_position"] is not None


def test_the_image_s_offset_is_taken_off(api: Api) -> None:
    found = api.told("/association", **label_at(*OFFSET_M, image="tile-1", image_sigma_m=0.35))
    assert found["distance_m"] == pytest.approx(math.hypot(*OFFSET_M), abs=1e-3)
    assert found["corrected_distance_m"] == pytest.approx(0.0, abs=1e-3)
    assert found["gate_m"] == pytest.approx(3.5 * math.sqrt(0.09 + 0.01 + 0.01), abs=1e-6)  # and the offset's variance


def test_a_label_that_is_moved_does_not_stand_in_its_own_way(api: Api) -> None:
    place = label_at(20.5, 0.0, image="tile-1", image_sigma_m=0.35)
    assert api.told("/association", **place)["landmark"] == ""
    moved = api.told("/association", **place, anchor="a0")
    assert (moved["landmark"], moved["already_anchored_by"]) == ("L2", ["a0@tile-1"])


def test_a_label_that_waits_for_the_next_version_counts_already(api: Api) -> None:
    lat_deg, lon_deg = degrees(-0.3, 0.0)
    label = NewLabel(
        anchor="waits",
        image="",
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        sigma_m=0.1,
        image_sigma_m=0.0,
        kind="pole",
        signature="",
    )
    assert isinstance(api.corrections, MemoryCorrections)
    api.corrections.label(label)
    assert [one["anchor"] for one in api.told("/labels")["labels"]] == ["waits"]
    try:
        found = api.told("/association", **label_at(-0.5, 0.0))
        before = api.told("/association", **label_at(-0.5, 0.0), as_of=1)
    finally:
        api.corrections.retract("waits", image=None, author="ann", reason="")
        assert api.told("/labels") == {"labels": []}
    assert (found["landmark"], found["reason"]) == ("", "another label is nearer to the landmark")
    assert before["reason"].startswith("no anchor is tied yet")


def test_before_the_first_anchor_is_tied_it_says_how_many_it_takes(api: Api) -> None:
    found = api.told("/association", **label_at(0.0, 0.0), as_of=1)
    assert found["landmark"] == ""
    assert "5 labels within 120 m agree on one shift" in found["reason"]
    assert "with this one there are 4" in found["reason"]
    assert found["distance_m"] == pytest.approx(0.0, abs=1e-3)


def test_what_a_label_would_tell_is_said_with_where_it_goes(api: Api) -> None:
    # L1's terms: expected 0.04 I, shared diag(0.2, 0.1) m^4; R = 0.1^2 + 0.5^2
    found = api.told("/association", **label_at(1.7, 0.0, image="new", image_sigma_m=0.5))
    assert found["landmark"] == "L1"
    assert found["expected_variance_reduction_m2"] == pytest.approx(0.3 / (0.04 + 0.01 + 0.25))


def test_a_label_far_from_the_whole_map_says_so(api: Api) -> None:
    found = api.told("/association", lat_deg=-33.0, lon_deg=151.0)
    assert (found["reason"], found["landmark_position"]) == ("no landmark within 4000 m", None)


@pytest.mark.parametrize(
    "wrong",
    [
        {"lat_deg": "91", "lon_deg": "0"},
        {"lon_deg": "151"},
        {"lat_deg": "-33", "lon_deg": "nan"},
        {"lat_deg": "-33", "lon_deg": "151", "sigma_m": "0"},
        {"lat_deg": "-33", "lon_deg": "151", "image": "x" * 201},
        {"lat_deg": "-33", "lon_deg": "151", "colour": "red"},
        {"lat_deg": "-33.9", "lon_deg": "151.2", "as_of": "x"},
    ],
)
def test_a_question_that_cannot_be_is_refused(api: Api, wrong: dict[str, str]) -> None:
    assert problem(api.get("/association", params=wrong))["status"] == 400


def test_suggestions_are_in_order_of_what_they_would_tell(api: Api) -> None:
    found = api.told("/anchor-suggestions", sigma_m=0.1, image_sigma_m=0.35)
    assert [one["landmark"] for one in found["suggestions"]] == ["L1", "L0"]  # the others are labelled already
    first = found["suggestions"][0]
    assert first["variance_reduction_m2"] == pytest.approx(0.3 / (0.04 + 0.01))  # in tile-1, whose offset is known
    assert found["summed_variance_m2"] == pytest.approx(5 * 0.08)
    assert first["share"] == pytest.approx(first["variance_reduction_m2"] / 0.4)
    assert (first["rank"], first["kind"], first["image"], first["image_choices"]) == (1, "pole", "tile-1", ["tile-1"])
    assert "map version 2" in found["method"]


def test_so_many_suggestions_and_no_more(api: Api) -> None:
    assert len(api.told("/anchor-suggestions", limit=1)["suggestions"]) == 1
    assert problem(api.get("/anchor-suggestions", params={"limit": 0}))["status"] == 400


def test_images_have_their_ground_and_their_offsets(api: Api) -> None:
    (image,) = api.told("/images")["images"]
    assert (image["image"], image["footprint_source"], image["anchor_count"]) == ("tile-1", "recorded", 3)
    assert (image["offset_x_m"], image["offset_y_m"]) == (0.2, -0.1)
    assert (image["sigma_major_m"], image["sigma_minor_m"]) == pytest.approx((0.1, 0.1))
    assert shape(image["footprint"]).covers(Point(*degrees(20.0, 0.0)[::-1]))


def test_the_history_says_of_each_version_how_it_was_solved(api: Api) -> None:
    found = api.told("/versions")
    assert found["versions"] == [1, 2]
    assert [(one["map_version"], one["method"], one["base_version"]) for one in found["history"]] == [
        (1, "anchored", 0),
        (2, "anchored", 0),
    ]
    assert {"solved_ns", "landmark_count", "anchor_count", "wall_s"} <= found["history"][0].keys()


@pytest.mark.parametrize("source", ["odometry", "filtered"])
def test_paths_are_lines_with_few_enough_places(api: Api, source: str) -> None:
    first, second = api.told("/paths", source=source)["features"]
    assert (first["id"], second["id"]) == (f"{source}:veh-a:b1", f"{source}:veh-c:b2")
    assert 100 < len(first["geometry"]["coordinates"]) <= 2000
    assert first["properties"]["pose_count"] == STEPS
    assert first["properties"]["length_m"] > 18_000.0


def test_one_drive_s_path_is_asked_for(api: Api) -> None:
    found = api.told("/paths", source="filtered", drive="veh-c:b2")
    assert [one["id"] for one in found["features"]] == ["filtered:veh-c:b2"]
    assert problem(api.get("/paths", params={"source": "truth"}))["status"] == 400
    assert problem(api.get("/paths"))["status"] == 400


def test_refused_fixes_say_why(api: Api) -> None:
    found = api.told("/fixes", accepted="false")
    assert (found["numberMatched"], found["numberReturned"], found["map_version"]) == (FIXES // 3, FIXES // 3, 2)
    assert {one["properties"]["reason"] for one in found["features"]} == {"outside gate"}
    assert found["features"][0]["id"] == "veh-a:b1:0"
    assert found["features"][0]["properties"]["sigma_m"] is None


def test_of_many_fixes_some_are_told_from_first_to_last(api: Api) -> None:
    found = api.told("/fixes")
    numbers = [one["properties"]["fix_sequence"] for one in found["features"]]
    assert (found["numberMatched"], found["numberReturned"], numbers[0], numbers[-1]) == (FIXES, 5000, 0, FIXES - 1)
    assert api.told("/fixes", drive="veh-z:b1")["features"] == []


def test_a_label_is_told_of_as_soon_as_it_is_in_the_log(api: Api) -> None:
    body = {"anchor": "a9", "image": "tile-1", "lat_deg": -33.9, "lon_deg": 151.2}
    assert api.ask("POST", "/anchors", json=body).status_code in (401, 403)  # no token, no label
    assert api.corrections is not None
    assert api.told("/labels") == {"labels": []}


def test_rasters_are_listed_and_their_tiles_served(api: Api) -> None:
    (found,) = api.told("/rasters")["rasters"]
    assert found["tiles"] == ["/rasters/air/{z}/{x}/{y}.png"]
    assert (found["bounds"], found["images"], found["maxzoom"]) == ([151.0, -34.0, 151.5, -33.5], ["tile-1"], 9)
    tile = api.get("/rasters/air/3/7/4.png")
    assert (tile.status_code, tile.content, tile.headers["content-type"]) == (200, PIXEL, "image/png")
    assert api.get("/rasters/air/3/7/4.png", headers={"If-None-Match": tile.headers["etag"]}).status_code == 304
    assert api.get("/rasters/air/3/1/1.png").status_code == 204


@pytest.mark.parametrize(
    "path",
    [
        "/rasters/sea/3/7/4.png",
        "/rasters/air/3/7/4.jpg",
        "/rasters/air/10/7/4.png",
        "/rasters/air/3/7/..%2Fsecret.png",
        "/rasters/air/..%2f..%2f/7/4.png",
        "/rasters/..%2fair/3/7/4.png",
        "/rasters/air/3/7/4",
        "/rasters/air/3/9/4.png",
    ],
)
def test_nothing_but_a_raster_s_tiles_is_served(api: Api, path: str) -> None:
    assert problem(api.get(path))["status"] == 404


@pytest.mark.parametrize("wrong", [{"bounds": (151.5, -34.0, 151.0, -33.5)}, {"minzoom": 9, "maxzoom": 8}])
def test_a_raster_that_is_nowhere_is_refused(tmp_path: Path, wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="raster air: bounds"):
        RasterSettings(**{"name": "air", "folder": tmp_path, "bounds": (151.0, -34.0, 151.5, -33.5), **wrong})


def test_a_link_does_not_lead_out_of_a_raster_s_folder(api: Api) -> None:
    assert api.get("/rasters/air/3/7/5.png").status_code == 204


def test_registered_images_are_listed_and_their_shifts_served(api: Api) -> None:
    (listed,) = api.told("/shifts")["shifts"]
    assert listed == {"image": "north 1", "tiles": "/shifts/north%201"}
    answer = api.get(listed["tiles"])
    told, refused = answer.json()["features"]
    assert (told["properties"]["length_m"], refused["properties"]["refused"]) == (0.5, "dark")
    assert answer.headers["content-type"] == "application/geo+json"
    assert api.get(listed["tiles"], headers={"If-None-Match": answer.headers["etag"]}).status_code == 304


@pytest.mark.parametrize("image", ["south", "secret", "..%2fsecret", "north%201.geojson", "%2e%2e"])
def test_nothing_but_registered_images_is_served(api: Api, image: str) -> None:
    assert problem(api.get(f"/shifts/{image}"))["status"] == 404


def test_requests_are_counted_by_the_pattern_of_their_path(api: Api) -> None:
    api.get("/collections/landmarks/items/L0")
    api.get("/nowhere/at/all")
    told = api.instruments.exposition().decode()
    assert 'trigpoint_requests_total{route="/collections/{name}/items/{feature_id}",status="200"}' in told
    assert 'trigpoint_requests_total{route="other",status="404"}' in told
    assert 'trigpoint_request_seconds_count{route="/association"}' in told

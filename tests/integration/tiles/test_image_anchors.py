"""`trigpoint ortho register` and `anchors`: an aerial image beside a layer, as a check and as anchors of the map."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from scanned_drives.examples import FRAME, arc, drive_rows, map_rows, pinned, solved_path
from scanned_drives.patched_ground import patched_ground, write_aerial_image
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.mapped import LandmarkSolved
from trigpoint.geodesy.projection import map_points_from_wgs84
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.readings import logged_anchors
from trigpoint_cli.ortho import command
from trigpoint_tiles.app import render_ortho
from trigpoint_tiles.settings import TilesSettings

POSES = arc(4.0)
SHIFT_M = (0.7, -0.4)
POLE_M, FAR_POLE_M = np.array([118.0, 212.0]), np.array([900.0, 900.0])


def pole(name: str, position_m: np.ndarray) -> LandmarkSolved:
    return LandmarkSolved(
        map_version=1,
        landmark=name,
        kind="pole",
        signature="",
        position_m=position_m,
        covariance_m2=np.eye(2) * 0.04,
        observation_count=9,
        vehicles=("car",),
        first_seen_ns=0,
        last_seen_ns=1,
        anchors=(),
        observations=(),
    )


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data directory, its layer and an aerial image in one folder."""
    folder = tmp_path_factory.mktemp("place")
    log = McapLog(folder / "data" / "log")
    log.append("map", [pinned()])
    log.append("veh-car", drive_rows("car", POSES, world=patched_ground))
    poles = (pole("pole-1", POLE_M), pole("pole-2", FAR_POLE_M))
    log.append("optimisation", map_rows([solved_path("car", POSES)], landmarks=poles))
    settings = TilesSettings(resolution_m=0.2, memory_bytes=512 * 1024**2)
    render_ortho(log, folder / "layer", formats=("cog",), settings=settings)
    log.close()
    write_aerial_image(folder / "north.tif", shift_m=SHIFT_M)
    return folder


def asked(place: Path, *words: str) -> dict[str, object]:
    layer = ("--ortho", str(place / "layer/ortho.tif"), "--image", str(place / "north.tif"))
    found = CliRunner().invoke(command, [*words, *layer, "--json"])
    assert found.exit_code == 0, found.exception
    return dict(json.loads(found.stdout))


def anchors_in(place: Path) -> list[AnchorLabelled]:
    log = McapLog(place / "data" / "log")
    found = list(logged_anchors(log))
    log.close()
    return found


def test_the_layer_for_gis_programs_has_every_tile_and_the_image_s_shift(place: Path) -> None:
    said = asked(place, "register", "--out", str(place / "shifts.geojson"))
    features = json.loads((place / "shifts.geojson").read_text(encoding="utf-8"))["features"]
    told = [one["properties"] for one in features if one["properties"]["refused"] is None]
    assert (len(features), len(told)) == (said["tiles"]["count"], said["tiles"]["accepted"])  # type: ignore[index]
    # Pixels of 0.2 m, half of them without a point: an eighth of a pixel.
    assert np.allclose([[one["shift_east_m"], one["shift_north_m"]] for one in told], SHIFT_M, atol=0.025)


def test_a_landmark_in_a_tile_that_tells_gets_an_anchor_where_the_image_shows_it(place: Path) -> None:
    asked(place, "anchors", "--data", str(place / "data"), "--image-sigma-m", "0.5")
    (anchor,) = anchors_in(place)
    at_m = map_points_from_wgs84(np.array([anchor.lat_deg]), np.array([anchor.lon_deg]), FRAME)[0]
    assert np.allclose(at_m, POLE_M + SHIFT_M, atol=0.025)
    assert (anchor.anchor, anchor.image, anchor.image_sigma_m) == ("measured/pole-1", "north", 0.5)
    assert 0.1 <= anchor.sigma_m < 0.15


def test_measured_again_there_is_still_one(place: Path) -> None:
    asked(place, "anchors", "--data", str(place / "data"))
    asked(place, "anchors", "--data", str(place / "data"))
    assert len(anchors_in(place)) == 1

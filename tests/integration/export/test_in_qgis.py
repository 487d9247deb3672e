"""Projects and exported files in QGIS itself; tests of it are marked `qgis`."""

import json
import math
import subprocess
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from command_runs.running import Run, trigpoint
from exported_maps.examples import fill, newest
from landmark_maps.examples import CRS
from map_http.served import ServedMap, geopackage_line, served_map
from qgis_reading.project import SYSTEM_PYTHON, SeenProject, seen

AROUND_M = (331_800.0, 6_247_850.0, 332_300.0, 6_248_250.0)
CENTIMETRE = 0.01
ELLIPSE_M = 0.01  # of a polygon of 36 corners around an ellipse of half a metre


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fill(tmp_path_factory.mktemp("data"))


@pytest.fixture(scope="module")
def geopackage(data: Path) -> Path:
    path = data / "map.gpkg"
    run = trigpoint("export", "gpkg", "--data", data, "--out", path)
    assert run.status == 0, run.err
    return path


@pytest.fixture(scope="module")
def served(data: Path) -> Iterator[ServedMap]:
    with served_map(data, database=geopackage_line(data / "landmarks.gpkg")) as found:
        yield found


@pytest.fixture(scope="module")
def of_file(geopackage: Path) -> SeenProject:
    project = geopackage.with_name("map.qgz")
    assert projecting(project, "--gpkg", geopackage).status == 0
    return seen(project, geopackage.with_name("file.png"), AROUND_M)


@pytest.fixture(scope="module")
def live(served: ServedMap, data: Path) -> SeenProject:
    project = data / "live.qgs"
    assert projecting(project, "--server", served.url).status == 0
    return seen(project, data / "live.png", AROUND_M)


def projecting(project: Path, *words: str | Path) -> Run:
    return trigpoint("export", "qgis", "--out", project, *words)


def farthest_m(found: SeenProject) -> float:
    places = found.points_m("Landmarks")
    return max(math.dist(places[name], (row.easting_m, row.northing_m)) for name, row in newest().items())


def require_true_ellipse(project: SeenProject) -> None:
    """The ellipse of a landmark is where it is and as large as its covariance has it."""
    row = newest()["L7"]
    west, south, east, north = project.layers["Landmarks"]["drawn_m"]["L7"]
    half_width_m = math.hypot(
        row.sigma_major_m * math.cos(row.ellipse_heading_rad), row.sigma_minor_m * math.sin(row.ellipse_heading_rad)
    )
    half_height_m = math.hypot(
        row.sigma_major_m * math.sin(row.ellipse_heading_rad), row.sigma_minor_m * math.cos(row.ellipse_heading_rad)
    )
    assert (east - west, north - south) == pytest.approx((2 * half_width_m, 2 * half_height_m), abs=ELLIPSE_M)
    assert ((west + east) / 2, (south + north) / 2) == pytest.approx((row.easting_m, row.northing_m), abs=CENTIMETRE)


@pytest.mark.qgis
def test_the_project_of_a_file_opens_whole_and_styled(of_file: SeenProject) -> None:
    assert of_file.crs == CRS
    assert of_file.title == "Landmark map, version 2"
    assert of_file.errors == []
    assert {name: one["valid"] for name, one in of_file.layers.items()} == dict.fromkeys(
        ("Anchors", "Landmarks", "Trajectories", "Image offsets"), True
    )
    assert of_file.layers["Landmarks"]["renderer"] == "QgsCategorizedSymbolRenderer"


@pytest.mark.qgis
@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:3857"])
def test_ellipses_are_true_to_scale_in_a_file_of_another_crs(data: Path, tmp_path: Path, crs: str) -> None:
    path, project = tmp_path / "map.gpkg", tmp_path / "map.qgz"
    assert trigpoint("export", "gpkg", "--data", data, "--out", path, "--crs", crs).status == 0
    assert projecting(project, "--gpkg", path).status == 0
    opened = seen(project, tmp_path / "map.png", AROUND_M)
    assert opened.crs == CRS
    require_true_ellipse(opened)


@pytest.mark.qgis
def test_every_landmark_of_a_file_is_in_its_place(of_file: SeenProject) -> None:
    assert of_file.layers["Landmarks"]["features"] == len(newest())
    assert farthest_m(of_file) < CENTIMETRE


@pytest.mark.qgis
def test_the_project_of_a_service_opens_whole(live: SeenProject) -> None:
    assert (live.crs, live.errors) == (CRS, [])
    assert [name for name, one in live.layers.items() if not one["valid"]] == []
    assert "Landmarks (tiles)" in live.layers


@pytest.mark.qgis
def test_qgis_s_own_provider_reads_every_landmark_where_it_is(live: SeenProject) -> None:
    assert sorted(live.points_m("Landmarks")) == sorted(newest())
    assert farthest_m(live) < CENTIMETRE


@pytest.mark.qgis
@pytest.mark.parametrize("name", ["of_file", "live"])
def test_ellipses_are_drawn_true_to_scale(name: str, request: pytest.FixtureRequest) -> None:
    project: SeenProject = request.getfixturevalue(name)
    require_true_ellipse(project)


@pytest.mark.qgis
@pytest.mark.parametrize("name", ["of_file", "live"])
def test_residuals_are_arrows_from_the_label_to_the_landmark(name: str, request: pytest.FixtureRequest) -> None:
    project: SeenProject = request.getfixturevalue(name)
    (x_m, y_m) = project.points_m("Anchors")["a1:tile-1"]
    arrow_m = project.layers["Anchors"]["drawn_m"]["a1:tile-1"]
    assert arrow_m == pytest.approx([x_m - 0.3, y_m, x_m, y_m + 0.4], abs=CENTIMETRE)
    assert "a3:tile-1" not in project.layers["Anchors"]["drawn_m"]  # tied to nothing


@pytest.mark.qgis
@pytest.mark.parametrize(("name", "picture"), [("of_file", "file.png"), ("live", "live.png")])
def test_the_picture_shows_paths_and_landmarks_in_their_colours(
    name: str, picture: str, data: Path, request: pytest.FixtureRequest
) -> None:
    request.getfixturevalue(name)
    with Image.open(data / picture) as image:
        colours = {tuple(colour) for colour in np.asarray(image.convert("RGB")).reshape(-1, 3).tolist()}
    assert (0, 114, 178) in colours  # poles
    assert len(colours - {(255, 255, 255)}) > 10


@pytest.mark.qgis
def test_gdal_s_validator_finds_nothing(geopackage: Path) -> None:
    words = [SYSTEM_PYTHON, "-m", "osgeo_utils.samples.validate_gpkg", "--extra", "--warning-as-error", str(geopackage)]
    finished = subprocess.run(words, capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr


def test_a_zipped_project_has_the_project_in_it(geopackage: Path, tmp_path: Path) -> None:
    project = tmp_path / "zipped.qgz"
    assert projecting(project, "--gpkg", geopackage).status == 0
    with zipfile.ZipFile(project) as archive:
        assert archive.namelist() == ["zipped.qgs"]


def test_the_project_of_a_file_names_it_from_its_own_folder(geopackage: Path, tmp_path: Path) -> None:
    project = tmp_path / "beside.qgs"
    run = projecting(project, "--gpkg", geopackage, "--json")
    assert run.answer["layers"] == ["Anchors", "Landmarks", "Trajectories", "Image offsets"]
    assert f"../{geopackage.parent.name}/map.gpkg|layername=landmarks" in project.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        ((), 2, "either --server or --gpkg"),
        (("--gpkg", "none.gpkg"), 2, "no such file"),
        (("--server", "ftp://example.com"), 2, "http://HOST"),
        (("--server", "http://a' b"), 2, "http://HOST"),
        (("--server", "http://me:secret@127.0.0.1"), 2, "http://HOST"),
        (("--server", "http://127.0.0.1:9"), 1, "no answer"),
        (("--server", "http://127.0.0.1:9", "--authcfg", "a' b"), 2, "letters and digits"),
    ],
)
def test_what_no_project_can_be_made_of_is_refused(
    tmp_path: Path, words: tuple[str, ...], status: int, said: str
) -> None:
    run = projecting(tmp_path / "refused.qgz", *words)
    assert (run.status, list(tmp_path.iterdir())) == (status, [])
    assert said in run.err


def test_a_landmark_database_is_not_taken_for_an_exported_file(data: Path, tmp_path: Path) -> None:
    run = projecting(tmp_path / "refused.qgz", "--gpkg", data / "landmarks.gpkg")
    assert run.status == 2
    assert "trigpoint export gpkg" in run.err


def test_another_service_is_not_taken_for_a_map(served: ServedMap, tmp_path: Path) -> None:
    run = projecting(tmp_path / "refused.qgz", "--server", served.health_url)
    assert run.status == 2
    assert json.dumps("status 404")[1:-1] in run.err


def test_a_service_with_tokens_is_asked_by_one_that_no_project_holds(data: Path, tmp_path: Path) -> None:
    tokens, own = tmp_path / "tokens.json", tmp_path / "token"
    issued = trigpoint("tokens", "issue", "gis", "--scope", "read", "--file", tokens, "--json").answer
    own.write_text(issued["token"] + "\n", encoding="ascii")
    (tmp_path / "served").mkdir()
    web = f"token_file = {json.dumps(str(tokens))}"
    database = geopackage_line(data / "landmarks.gpkg")
    with served_map(tmp_path / "served", database=database, web=web) as served:
        refused = projecting(tmp_path / "map.qgs", "--server", served.url)
        words = ("--server", served.url, "--token-file", own, "--authcfg", "gis0001")
        assert projecting(tmp_path / "map.qgs", *words).status == 0
    written = (tmp_path / "map.qgs").read_text(encoding="utf-8")
    assert (refused.status, "status 401" in refused.err) == (2, True)
    assert (issued["token"] in written, "authcfg=gis0001" in written) == (False, True)

"""Exported maps as GDAL and Arrow read them: every feature in its place, its uncertainty whole, no text lost."""

import csv
import json
import math
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_runs.running import Run, trigpoint
from exported_maps.examples import ODD_TEXTS, fill, map_changes, newest
from exported_maps.reading import SUFFIXES, read_layer, without_ends
from landmark_maps.examples import CRS, ORIGIN
from trigpoint.geodesy.projection import WGS84, transform_coordinates

MILLIMETRE = 1e-3  # the files keep a tenth of it
DEGREE_M = 111_320.0
FORMATS = sorted(SUFFIXES)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fill(tmp_path_factory.mktemp("data"))


def exported(data: Path, out: Path, form: str, *words: str | int | float) -> Path:
    """The file a command wrote."""
    path = out / f"map.{SUFFIXES[form]}"
    run = exporting(data, path, form, *words)
    assert run.status == 0, run.err
    return path


def exporting(data: Path, path: Path, form: str, *words: str | int | float) -> Run:
    return trigpoint("export", form, "--data", data, "--out", path, *words)


def farthest_m(found: dict[str, tuple[float, float]], expected: dict[str, tuple[float, float]], unit_m: float) -> float:
    """How far the worst one is from its place."""
    return max(unit_m * math.dist(found[name], place) for name, place in expected.items() if name == name.strip())


@pytest.mark.parametrize("form", FORMATS)
def test_every_landmark_is_in_its_place_in_the_usual_crs(data: Path, tmp_path: Path, form: str) -> None:
    read = read_layer(exported(data, tmp_path, form))
    degrees = form in ("geojson", "kml")
    expected = {
        name: (row.lon_deg, row.lat_deg) if degrees else (row.easting_m, row.northing_m)
        for name, row in newest().items()
    }
    assert without_ends(read.places) == without_ends(expected)
    assert farthest_m(read.places, expected, DEGREE_M if degrees else 1.0) < MILLIMETRE
    assert ("4326" if degrees else "32756") in read.crs


@pytest.mark.parametrize("form", ["gpkg", "geojson", "geoparquet", "csv"])
@pytest.mark.parametrize("crs", ["EPSG:3857", "EPSG:7856", "EPSG:7844"])
def test_another_crs_has_x_or_longitude_first(data: Path, tmp_path: Path, form: str, crs: str) -> None:
    read = read_layer(exported(data, tmp_path, form, "--crs", crs))
    rows = newest()
    lon_deg, lat_deg = np.array([(row.lon_deg, row.lat_deg) for row in rows.values()]).T
    x, y = transform_coordinates(lon_deg, lat_deg, source_crs=WGS84, target_crs=crs)
    expected = dict(zip(rows, zip(x.tolist(), y.tolist(), strict=True), strict=True))
    assert farthest_m(read.places, expected, DEGREE_M if crs == "EPSG:7844" else 1.0) < MILLIMETRE


@pytest.mark.parametrize("form", ["gpkg", "geoparquet", "csv", "kml"])
def test_the_uncertainty_is_whole(data: Path, tmp_path: Path, form: str) -> None:
    columns = read_layer(exported(data, tmp_path, form)).columns
    names = ("variance_x_m2", "covariance_xy_m2", "variance_y_m2", "sigma_major_m", "ellipse_heading_rad")
    at = columns["landmark"].index("L7")
    row = newest()["L7"]
    assert [float(columns[name][at]) for name in names] == pytest.approx(
        [getattr(row, name) for name in names], abs=1e-4
    )
    assert int(columns["first_seen_ns"][at]) == row.first_seen_ns


def test_geojson_has_the_keys_of_the_http_service(data: Path, tmp_path: Path) -> None:
    collection = json.loads(exported(data, tmp_path, "geojson").read_bytes())
    (one,) = [feature for feature in collection["features"] if feature["id"] == "L7"]
    assert one["properties"]["covariance_m2"] == [[0.04, 0.01], [0.01, 0.09]]
    assert one["properties"]["vehicles"] == ["veh-a", "veh-b"]
    assert collection["map_version"] == 2
    assert "crs" not in collection  # RFC 7946, 4


@pytest.mark.parametrize("form", ["gpkg", "geojson", "geoparquet"])
def test_no_text_is_lost(data: Path, tmp_path: Path, form: str) -> None:
    columns = read_layer(exported(data, tmp_path, form)).columns
    signatures = dict(zip(columns["landmark"], columns["signature"], strict=True))
    assert {text: signatures.get(text) for text in ODD_TEXTS} == {text: text for text in ODD_TEXTS}


def test_no_text_of_a_csv_file_is_run_as_a_formula_and_none_is_lost(data: Path, tmp_path: Path) -> None:
    path = exported(data, tmp_path, "csv")
    with path.open(encoding="utf-8", newline="") as file:
        texts = [row["signature"] for row in csv.DictReader(file)]
    assert [text for text in texts if text.startswith(("=", "+", "-", "@", "\t", "\r", "\n"))] == []
    taken_away = {text.removeprefix("'") for text in texts}
    assert set(ODD_TEXTS) <= taken_away


def test_no_text_of_a_kml_file_is_markup(data: Path, tmp_path: Path) -> None:
    names = read_layer(exported(data, tmp_path, "kml")).columns["landmark"]
    assert {text.strip() for text in ODD_TEXTS} <= {name.strip() for name in names}


@pytest.mark.parametrize("form", FORMATS)
def test_an_older_version_is_as_it_was(data: Path, tmp_path: Path, form: str) -> None:
    read = read_layer(exported(data, tmp_path, form, "--as-of", 1))
    degrees = form in ("geojson", "kml")
    row = map_changes()[0].opened[0]  # which the second version moves by 10 m
    expected = (row.lon_deg, row.lat_deg) if degrees else (row.easting_m, row.northing_m)
    off_m = math.dist(read.places[row.landmark], expected) * (DEGREE_M if degrees else 1.0)
    assert off_m < MILLIMETRE


@pytest.mark.parametrize("form", FORMATS)
def test_a_box_of_nothing_gives_a_file_of_nothing(data: Path, tmp_path: Path, form: str) -> None:
    read = read_layer(exported(data, tmp_path, form, "--bbox", "0,0,1,1"))
    assert len(read.geometries) == 0


def test_a_box_holds_what_is_in_it(data: Path, tmp_path: Path) -> None:
    west, south, east, north = 151.180, -33.900, 151.190, -33.890
    inside = {name for name, row in newest().items() if west <= row.lon_deg <= east and south <= row.lat_deg <= north}
    read = read_layer(exported(data, tmp_path, "gpkg", "--bbox", f"{west},{south},{east},{north}"))
    assert set(read.places) == inside


def test_conditions_hold_together(data: Path, tmp_path: Path) -> None:
    words = ("--layer", "landmarks", "--filter", "kind = 'pole' AND observation_count < 100", "--max-sigma-m", 0.5)
    read = read_layer(exported(data, tmp_path, "gpkg", *words))
    expected = {
        name
        for name, row in newest().items()
        if row.kind == "pole" and row.observation_count < 100 and row.sigma_major_m <= 0.5
    }
    assert set(read.places) == expected


def test_paths_are_lines_in_every_format(data: Path, tmp_path: Path) -> None:
    ends = []
    for form in ("gpkg", "geoparquet", "csv"):
        read = read_layer(exported(data, tmp_path, form, "--layer", "trajectories"), "trajectories")
        first = read.geometries[read.columns["vehicle"].index("veh-a")]
        ends.append((first.geom_type, len(first.coords), *np.round(first.coords[0], 3).tolist()))
    assert ends == [("LineString", 200, ORIGIN.easting_m - 900.0, 6_248_055.883)] * 3


def test_an_anchor_without_a_place_is_kept_without_one(data: Path, tmp_path: Path) -> None:
    read = read_layer(exported(data, tmp_path, "geoparquet", "--layer", "anchors"))
    without = [name for name, place in zip(read.columns["anchor"], read.geometries, strict=True) if place is None]
    assert without == ["a3"]


def test_gdal_s_own_program_finds_nothing_to_say_about_a_geopackage(data: Path, tmp_path: Path) -> None:
    path = exported(data, tmp_path, "gpkg")
    finished = subprocess.run(["ogrinfo", "-ro", "-al", "-so", str(path)], capture_output=True, text=True, check=True)
    assert finished.stderr == ""
    assert "Coordinate epoch: 2023.87" in finished.stdout
    assert f"Feature Count: {len(newest())}" in finished.stdout
    layers = {line.split()[2] for line in finished.stdout.splitlines() if line.startswith("Layer name")}
    assert layers == {"landmarks", "trajectories", "anchors", "image_offsets", "layer_styles"}


@pytest.mark.parametrize("form", FORMATS)
def test_the_answer_says_what_was_written(data: Path, tmp_path: Path, form: str) -> None:
    path = tmp_path / f"map.{SUFFIXES[form]}"
    answer: dict[str, Any] = exporting(data, path, form, "--json").answer
    assert answer["features"]["landmarks"] == len(newest())
    assert (answer["map_version"], answer["coordinate_epoch"]) == (2, pytest.approx(2023.87, abs=0.01))
    assert answer["files"][0] == {"path": str(path), "size_bytes": path.stat().st_size}
    assert answer["crs"] == ("OGC:CRS84" if form in ("geojson", "kml") else CRS)


@pytest.mark.parametrize("form", FORMATS)
def test_a_file_that_is_there_is_replaced_only_by_force(data: Path, tmp_path: Path, form: str) -> None:
    path = tmp_path / f"map.{SUFFIXES[form]}"
    path.write_text("mine", encoding="utf-8")
    refused = exporting(data, path, form)
    assert (refused.status, path.read_text(encoding="utf-8")) == (2, "mine")
    assert "is there already" in refused.err
    assert exporting(data, path, form, "--force").status == 0
    assert [file.name for file in tmp_path.iterdir() if file.name.endswith(".part")] == []


def test_no_file_beside_a_csv_file_is_replaced_unasked(data: Path, tmp_path: Path) -> None:
    (tmp_path / "map.prj").write_text("of a shapefile", encoding="utf-8")
    refused = exporting(data, tmp_path / "map.csv", "csv")
    assert refused.status == 2
    assert "map.prj is there already" in refused.err
    assert [file.name for file in tmp_path.iterdir()] == ["map.prj"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("csv", "--layer", "drives"), "there is none in the data directory"),
        (("geoparquet", "--layer", "image_offsets"), "has no geometry"),
        (("csv", "--layer", "anchors", "--layer", "landmarks"), "holds one layer"),
        (("gpkg", "--filter", "kind = 'pole'"), "goes with one layer"),
        (("gpkg", "--layer", "anchors", "--max-sigma-m", "1"), "is of landmarks"),
        (("kml", "--crs", "EPSG:32756"), "always on WGS 84"),
        (("gpkg", "--crs", "EPSG:2263"), "degrees or metres are needed"),
        (("gpkg", "--crs", "EPSG:999999"), "is not known"),
        (("gpkg", "--crs", "sydney"), "is not EPSG:"),
        (("gpkg", "--as-of", "9"), "9 is unknown"),
        (("geojson", "--filter", "colour = 'red'"), "colour"),
    ],
)
def test_what_cannot_be_is_refused_and_leaves_no_file(
    data: Path, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    run = exporting(data, tmp_path / "refused", words[0], *words[1:])
    assert run.status == 2
    assert said in run.err
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there_is_named(data: Path, tmp_path: Path) -> None:
    run = exporting(data, tmp_path / "none" / "map.gpkg", "gpkg")
    assert run.status == 2
    assert "none" in run.err

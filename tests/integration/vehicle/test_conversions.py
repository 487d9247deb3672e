"""Converting and simulating write logs, truth and anchors that can be read back."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from trigpoint.errors import InputError
from trigpoint.events.truth import Truth, truth_from_lines
from trigpoint.logs.vehicle_log import read_vehicle_log
from trigpoint_vehicle.app import convert_mrclam, convert_table, convert_victoria_park, record_campus, write_conversion
from trigpoint_vehicle.core.campus import conversion_of, simulate_campus
from trigpoint_vehicle.core.campus_settings import CampusSettings, RouteSettings, with_plan
from trigpoint_vehicle.core.recording import Conversion
from trigpoint_vehicle.settings import SimulationSettings

MANIFEST = '[[vehicle]]\nname = "car"\nfile = "car.csv"\nfixes = { time = "t", lat = "lat", lon = "lon" }\n'


@pytest.fixture(scope="module")
def short_campus() -> Conversion:
    settings = CampusSettings(vehicles=1, route=RouteSettings(straight_length_m=100.0))
    return conversion_of(simulate_campus(2, with_plan(settings, "straight")))


def write_table(folder: Path, rows: str, manifest: str = MANIFEST) -> Path:
    (folder / "car.csv").write_text(rows, encoding="utf-8")
    (folder / "drive.toml").write_text(manifest, encoding="utf-8")
    return folder / "drive.toml"


def truth_of(path: Path) -> Truth:
    return truth_from_lines(path.read_text(encoding="utf-8").splitlines(keepends=True))


def test_every_event_of_a_recording_is_in_its_log(short_campus: Conversion, tmp_path: Path) -> None:
    (log,) = write_conversion(short_campus, tmp_path).logs
    identities = {message.identity for message in read_vehicle_log(log)}
    assert log.name == "vehicle-1.mcap"
    assert identities == {row.identity for row in short_campus.recordings[0].rows}


def test_the_same_campus_written_twice_is_the_same_bytes(short_campus: Conversion, tmp_path: Path) -> None:
    names = ("vehicle-1.mcap", "truth.csv", "anchors.geojson")
    for folder in ("a", "b"):
        write_conversion(short_campus, tmp_path / folder)
    assert all((tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes() for name in names)


def test_truth_is_read_back_as_it_was(short_campus: Conversion, tmp_path: Path) -> None:
    written = write_conversion(short_campus, tmp_path)
    assert written.truth is not None
    known, read = short_campus.truth, truth_of(written.truth)
    assert read.fixes[0].state == known.fixes[0].state
    assert read.paths[0].stamp_ns.tolist() == known.paths[0].stamp_ns.tolist()
    assert read.paths[0].lat_deg == pytest.approx(known.paths[0].lat_deg, abs=1e-11)  # deg, the decimals written
    assert [label.landmark for label in read.labels] == [label.landmark for label in known.labels]


def test_anchors_are_geojson_points_longitude_first(short_campus: Conversion, tmp_path: Path) -> None:
    written = write_conversion(short_campus, tmp_path)
    assert written.anchors is not None
    feature = json.loads(written.anchors.read_text(encoding="utf-8"))["features"][0]
    anchor = short_campus.anchors[0]
    assert feature["geometry"]["coordinates"] == pytest.approx([anchor.lon_deg, anchor.lat_deg], abs=1e-10)
    assert set(feature["properties"]) == {"anchor", "image", "sigma_m", "image_sigma_m", "kind", "signature"}


def test_a_source_without_truth_leaves_no_truth_file(short_campus: Conversion, tmp_path: Path) -> None:
    written = write_conversion(replace(short_campus, truth=Truth(), anchors=()), tmp_path)
    assert (written.truth, written.anchors) == (None, None)
    assert [path.name for path in tmp_path.iterdir()] == ["vehicle-1.mcap"]


def test_a_table_becomes_a_log(tmp_path: Path) -> None:
    manifest = write_table(tmp_path, "t,lat,lon\n1,-33.9,151.2\n2,-33.9,151.2\n")
    (log,) = convert_table(manifest, tmp_path / "out").logs
    assert len(list(read_vehicle_log(log))) == 3  # the description and two fixes


def test_a_broken_cell_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    manifest = write_table(tmp_path, "t,lat,lon\n1,-33.9,151.2\n2,here,151.2\n")
    with pytest.raises(InputError, match=r"car.csv, row 3: lat is 'here', not a number"):
        convert_table(manifest, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_file_that_is_not_there_is_refused_by_name(tmp_path: Path) -> None:
    manifest = write_table(tmp_path, "", MANIFEST.replace("car.csv", "van.csv"))
    with pytest.raises(InputError, match=r"van.csv: cannot be read"):
        convert_table(manifest, tmp_path / "out")


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    manifest = write_table(tmp_path, "")
    (tmp_path / "car.csv").write_bytes(b"t,lat,lon\n\xff\xfe,1,2\n")
    with pytest.raises(InputError, match=r"car.csv: cannot be read"):
        convert_table(manifest, tmp_path / "out")


@pytest.mark.parametrize("convert", [convert_mrclam, convert_victoria_park])
def test_a_folder_without_the_files_is_refused(convert: object, tmp_path: Path) -> None:
    assert callable(convert)
    with pytest.raises(InputError, match=str(tmp_path)):
        convert(tmp_path, tmp_path / "out")


def test_an_output_folder_that_cannot_be_made_is_refused(short_campus: Conversion, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file stands here", encoding="utf-8")
    with pytest.raises(InputError, match="cannot be written"):
        write_conversion(short_campus, tmp_path / "out")


@pytest.mark.parametrize(("seed", "vehicles"), [(-1, 2), (1, 0), (1, 51)])
def test_a_simulation_outside_its_limits_is_refused(seed: int, vehicles: int, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"{seed if seed < 0 else vehicles}"):
        record_campus(SimulationSettings(seed=seed, vehicles=vehicles), tmp_path)

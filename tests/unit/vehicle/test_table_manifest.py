"""A manifest is refused where it leaves something to be guessed."""

from pathlib import Path

import pytest

from trigpoint.errors import InputError
from trigpoint_vehicle.core.table_manifest import Manifest, parsed_manifest

FIXES = 'fixes = { time = "t", lat = "lat", lon = "lon" }'
GUIDE = Path(__file__).parents[3] / "docs" / "convert-table.md"


def manifest(vehicle: str = FIXES, rest: str = "") -> Manifest:
    return parsed_manifest("drive.toml", f'{rest}\n[[vehicle]]\nname = "car"\nfile = "car.csv"\n{vehicle}\n')


def test_the_guides_example_is_a_manifest() -> None:
    example = GUIDE.read_text(encoding="utf-8").split("```toml\n")[1].split("```")[0]
    parsed = parsed_manifest("guide", example)
    assert [vehicle.name for vehicle in parsed.vehicle] == ["shuttle-1", "shuttle-2"]
    assert parsed.files() == ("shuttle1.csv", "shuttle1_poles.csv", "shuttle2.csv", "shuttle2_survey.csv", "poles.csv")


def test_a_bare_text_is_a_column_and_a_bare_number_a_value() -> None:
    (fixes,) = manifest('fixes = { time = "t", lat = "lat", lon = "lon", sigma = 3 }').vehicle[0].fixes
    assert (fixes.lat.column, fixes.sigma.value) == ("lat", 3.0)  # type: ignore[union-attr]


def test_an_unknown_unit_is_refused_with_those_there_are() -> None:
    with pytest.raises(InputError, match=r"speed.unit: Input should be 'm/s', 'km/h', 'mph' or 'kn', not 'furlong/d'"):
        manifest('wheel_speeds = { time = "t", speed = { column = "v", unit = "furlong/d" } }')


def test_an_unknown_key_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"vehicle.0.colour: Extra inputs are not permitted"):
        manifest('colour = "red"')


@pytest.mark.parametrize(
    "position", ['lat = "a"', 'east = "a"', 'lat = "a", lon = "b", east = "c", north = "d"', 'lat = "a", north = "b"']
)
def test_half_a_position_or_two_of_them_are_refused(position: str) -> None:
    with pytest.raises(InputError, match="give either lat and lon or east and north"):
        manifest(f'fixes = {{ time = "t", {position} }}')


@pytest.mark.parametrize("place", ['range = "r"', 'range = "r", y = "y"', 'range = "r", bearing = "b", x = "x"'])
def test_half_a_detection_or_two_of_them_are_refused(place: str) -> None:
    with pytest.raises(InputError, match="give either range and bearing or x and y"):
        manifest(f'detections = {{ time = "t", {place} }}')


def test_a_quantity_from_a_column_and_a_value_is_refused() -> None:
    with pytest.raises(InputError, match="give either a column or a value"):
        manifest('wheel_speeds = { time = "t", speed = { column = "v", value = 3 } }')


def test_a_local_frame_without_an_origin_is_refused_with_what_it_needs() -> None:
    with pytest.raises(InputError, match="a local frame needs either origin_lat_deg and origin_lon_deg"):
        manifest(rest='frame = { kind = "local" }')


def test_wheel_pairs_need_a_track() -> None:
    with pytest.raises(InputError, match="its geometry needs track_m above 0"):
        manifest('wheel_pairs = { time = "t", left = "l", right = "r" }')


def test_an_epoch_without_its_zone_is_refused() -> None:
    with pytest.raises(InputError, match="clock.epoch: Input should have timezone info"):
        manifest(rest="clock = { epoch = 2024-03-04T00:00:00 }")


@pytest.mark.parametrize("year", ["0001", "9999"])
def test_an_epoch_whose_stamps_fit_no_log_is_refused(year: str) -> None:
    with pytest.raises(InputError, match=f"clock: .*epoch {year}-.* is outside the years 1900 to 2100"):
        manifest(rest=f"clock = {{ epoch = {year}-03-04T00:00:00Z }}")


@pytest.mark.parametrize("name", ["", "../car", "a/b", "*", "a b"])
def test_a_name_that_is_no_file_and_no_key_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=r"vehicle.0.name"):
        parsed_manifest("drive.toml", f'[[vehicle]]\nname = "{name}"\nfile = "car.csv"')


def test_a_vehicle_named_twice_is_refused() -> None:
    with pytest.raises(InputError, match="a vehicle's name stands twice in car, car"):
        manifest(FIXES + '\n[[vehicle]]\nname = "car"\nfile = "b.csv"')


def test_a_part_without_a_file_anywhere_is_refused() -> None:
    with pytest.raises(InputError, match="vehicle 'car' has no file"):
        parsed_manifest("drive.toml", f'[[vehicle]]\nname = "car"\n{FIXES}')


def test_what_is_not_toml_is_refused_with_its_place() -> None:
    with pytest.raises(InputError, match=r"drive.toml: not TOML: .*line 1"):
        parsed_manifest("drive.toml", "vehicle = }")


def test_a_part_may_be_a_list() -> None:
    part = 'time = "t", lat = "lat", lon = "lon"'
    parsed = manifest(f'fixes = [{{ file = "a.csv", {part} }}, {{ file = "b.csv", {part} }}]')
    assert parsed.files() == ("a.csv", "b.csv")


@pytest.mark.parametrize(
    "vehicle",
    ['inertial = { time = { column = "t", offset_s = inf }, yaw_rate = "w" }', "geometry = { track_m = nan }"],
)
def test_a_number_that_is_not_finite_is_refused(vehicle: str) -> None:
    with pytest.raises(InputError, match="Input should be a finite number"):
        manifest(vehicle)

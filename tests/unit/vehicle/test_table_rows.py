"""Rows of anyone's tables become the events, truth and anchors the manifest says they are."""

import math
from pathlib import Path

import numpy as np
import pytest

from trigpoint.errors import FrameRefused, InputError
from trigpoint.events.drives import Drive, drives_of
from trigpoint.events.observed import LandmarksDetected
from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.projection import map_points_from_wgs84, pin_map_frame_at
from trigpoint_vehicle.core.recording import Conversion
from trigpoint_vehicle.core.table_manifest import parsed_manifest
from trigpoint_vehicle.core.table_rows import converted_tables
from trigpoint_vehicle.core.text_tables import SourceText
from trigpoint_vehicle.source_files import read_source

NCLT = Path(__file__).parents[2] / "figures" / "nclt.toml"


def converted(part: str, rows: str, rest: str = "") -> Conversion:
    text = f'{rest}\n[[vehicle]]\nname = "car"\nfile = "car.csv"\ngeometry = {{ track_m = 1.5 }}\n{part}\n'
    return converted_tables(parsed_manifest("drive.toml", text), text, [SourceText("car.csv", rows)])


def drive_of_rows(part: str, rows: str, rest: str = "") -> Drive:
    (drive,) = drives_of(converted(part, rows, rest).recordings[0].rows)
    return drive


def test_speed_and_steering_come_out_in_metres_a_second_and_radians() -> None:
    part = """[vehicle.wheel_speeds]
    time = { column = "t", unit = "ms" }
    speed = { column = "v", unit = "km/h" }
    steering = { column = "s", unit = "deg", factor = -1 }"""
    wheels = drive_of_rows(part, "t,v,s\n500,36,90\n").wheels
    assert wheels.stamp_ns.tolist() == [500_000_000]
    assert wheels.speed_mps[0] == pytest.approx(10.0)
    assert wheels.steering_rad[0] == pytest.approx(-math.pi / 2.0)
    assert math.isnan(wheels.yaw_rate_radps[0])


def test_two_wheels_turn_by_their_difference_over_the_track() -> None:
    wheels = drive_of_rows('wheel_pairs = { time = "t", left = "l", right = "r" }', "t,l,r\n1,1.0,1.3\n").wheels
    assert wheels.speed_mps[0] == pytest.approx(1.15)
    assert wheels.yaw_rate_radps[0] == pytest.approx(0.2)


def test_a_row_without_a_number_is_no_measurement() -> None:
    part = 'fixes = { time = "t", lat = "lat", lon = "lon" }'
    fixes = drive_of_rows(part, "t,lat,lon\n1,-33.9,151.2\n2,nan,151.2\n3,-33.8,\n").fixes
    assert fixes.stamp_ns.tolist() == [1_000_000_000]


def test_fixes_of_a_projected_crs_come_out_in_degrees() -> None:
    part = 'fixes = { time = "t", east = "e", north = "n" }'
    frame = 'frame = { kind = "projected", crs = "EPSG:32617" }'
    fixes = drive_of_rows(part, "t,e,n\n1,500000,4649776.22\n", frame).fixes
    # on the central meridian of zone 17; 4 649 776 m north of the equator is 42 degrees
    assert (fixes.lat_deg[0], fixes.lon_deg[0]) == pytest.approx((42.0, -81.0), abs=1e-6)


def test_a_gps_clock_loses_its_leap_seconds() -> None:
    part = 'fixes = { time = "t", lat = "lat", lon = "lon" }'
    fixes = drive_of_rows(part, "t,lat,lon\n1393459200,-33.9,151.2\n", 'clock = { scale = "gps" }').fixes
    # 2304 weeks of GPS: 2024-03-03T00:00:00 less 18 s
    assert fixes.stamp_ns[0] == (1_709_424_000 - 18) * 1_000_000_000


def test_a_late_sensor_is_put_back_to_its_time() -> None:
    part = 'wheel_speeds = { time = { column = "t", offset_s = -0.25 }, speed = "v" }'
    assert drive_of_rows(part, "t,v\n1,2\n").wheels.stamp_ns.tolist() == [750_000_000]


def test_detections_of_a_time_are_one_sweep_and_a_row_of_nothing_an_empty_one() -> None:
    part = 'detections = { time = "t", range = "r", bearing = "b", signature = { column = "id", prefix = "pole-" } }'
    rows = converted(part, "t,r,b,id\n1,10,0.5,7\n1,12,-0.5,\n2,,,\n").recordings[0].rows
    sweeps = [row.event.detections for row in rows if isinstance(row.event, LandmarksDetected)]
    assert [[seen.signature for seen in sweep] for sweep in sweeps] == [["pole-7", ""], []]


def test_detections_in_the_vehicles_frame_are_seen_from_the_sensor() -> None:
    part = """[vehicle.detections]
    time = "t"
    x = "x"
    y = "y"
    """
    text = f"""[[vehicle]]
    name = "car"
    file = "car.csv"
    geometry = {{ landmark_sensor_x_m = 2.0, landmark_sensor_y_m = 0.5, landmark_sensor_yaw_rad = 0.1 }}
    {part}"""
    rows = SourceText("car.csv", "t,x,y\n1,5.0,4.5\n")
    (drive,) = drives_of(converted_tables(parsed_manifest("m", text), text, [rows]).recordings[0].rows)
    assert drive.detections.range_m[0] == pytest.approx(5.0)  # 3 ahead, 4 left
    assert drive.detections.bearing_rad[0] == pytest.approx(math.atan2(4.0, 3.0) - 0.1)


def test_true_compass_headings_come_out_from_grid_east() -> None:
    part = """[vehicle.true_path]
    time = "t"
    lat = "lat"
    lon = "lon"
    heading = { column = "course", unit = "deg", zero = "north", turn = "clockwise" }"""
    conversion = converted(part, "t,lat,lon,course\n1,42.293227,-83.709657,90\n")
    frame = pin_map_frame_at(Wgs84Position(42.293227, -83.709657))
    # true east is turned from grid east by the convergence, -1.8 degrees there
    assert conversion.truth.paths[0].heading_rad[0] == pytest.approx(frame.convergence_rad, abs=3e-4)


def test_anchors_have_their_sigma_and_image() -> None:
    anchors = """[anchors]
    file = "car.csv"
    name = { column = "id", prefix = "p" }
    lat = "lat"
    lon = "lon"
    sigma = { value = 5, unit = "cm" }
    image = "tile"
    image_sigma = 0.35
    """
    text = f'{anchors}\n[[vehicle]]\nname = "car"\n'
    rows = SourceText("car.csv", "id,lat,lon,tile\n1,-33.9,151.2,a\n2,,,a\n")
    (anchor,) = converted_tables(parsed_manifest("m", text), text, [rows]).anchors
    assert (anchor.anchor, anchor.image, anchor.sigma_m, anchor.image_sigma_m) == ("p1", "a", 0.05, 0.35)


def test_an_anchor_without_a_sigma_is_refused_with_its_row() -> None:
    text = '[anchors]\nfile = "a.csv"\nname = "id"\nlat = "lat"\nlon = "lon"\nsigma = "s"\n[[vehicle]]\nname = "car"\n'
    rows = SourceText("a.csv", "id,lat,lon,s\n1,-33.9,151.2,0.1\n2,-33.9,151.3,0\n")
    with pytest.raises(InputError, match="a.csv, row 3: an anchor needs a sigma above 0"):
        converted_tables(parsed_manifest("m", text), text, [rows])


def test_degrees_in_a_frame_of_metres_are_refused() -> None:
    part = 'fixes = { time = "t", lat = "lat", lon = "lon" }'
    with pytest.raises(InputError, match="car.csv: its frame 'EPSG:32617' needs east and north"):
        drive_of_rows(part, "t,lat,lon\n1,42,-83\n", 'frame = { kind = "projected", crs = "EPSG:32617" }')


def test_an_unknown_crs_is_refused_by_name() -> None:
    part = 'fixes = { time = "t", east = "e", north = "n" }'
    with pytest.raises(FrameRefused, match="EPSG:999999"):
        drive_of_rows(part, "t,e,n\n1,2,3\n", 'frame = { kind = "projected", crs = "EPSG:999999" }')


def test_a_declared_origin_travels_with_the_drive() -> None:
    frame = 'frame = { kind = "local", crs = "EPSG:32617", origin_easting_m = 623000, origin_northing_m = 4848000 }'
    described = drive_of_rows('wheel_speeds = { time = "t", speed = "v" }', "t,v\n1,2\n", frame).described
    assert (described.declared_crs, described.declared_origin_northing_m) == ("EPSG:32617", 4_848_000.0)


@pytest.fixture(scope="module")
def nclt(recorded_drives: Path) -> Conversion:
    text = NCLT.read_text(encoding="utf-8")
    manifest = parsed_manifest(NCLT.name, text)
    return converted_tables(manifest, text, [read_source(recorded_drives / "nclt", name) for name in manifest.files()])


@pytest.mark.data
def test_nclt_fixes_err_from_truth_as_published(nclt: Conversion) -> None:
    frame = pin_map_frame_at(Wgs84Position(42.293227, -83.709657))
    means_m = []
    for recording, path in zip(nclt.recordings, nclt.truth.paths, strict=True):
        (drive,) = drives_of(recording.rows)
        true_m = map_points_from_wgs84(path.lat_deg, path.lon_deg, frame)
        at = np.searchsorted(path.stamp_ns, drive.fixes.stamp_ns)
        fix_m = map_points_from_wgs84(drive.fixes.lat_deg, drive.fixes.lon_deg, frame)
        means_m.append(float(np.hypot(*(fix_m - true_m[at]).T).mean()))
    assert means_m == pytest.approx([10.3, 5.8], abs=0.05)  # m, to the figures' digits


@pytest.mark.data
def test_nclt_headings_point_where_the_path_goes(nclt: Conversion) -> None:
    path = nclt.truth.paths[0]
    point_m = map_points_from_wgs84(path.lat_deg, path.lon_deg, pin_map_frame_at(Wgs84Position(42.293227, -83.709657)))
    step_m = np.diff(point_m, axis=0)
    moving = np.hypot(*step_m.T) > 0.8
    off = np.arctan2(step_m[:, 1], step_m[:, 0]) - path.heading_rad[:-1]
    # a heading left on true north would be off by 1.8 degrees
    assert abs(np.degrees(np.median(np.angle(np.exp(1j * off[moving]))))) < 0.3


def test_a_map_crs_is_declared_with_an_origin_near_the_first_fix() -> None:
    part = 'fixes = { time = "t", lat = "lat", lon = "lon" }'
    described = drive_of_rows(part, "t,lat,lon\n1,nan,nan\n2,-33.8886,151.1873\n", 'map_crs = "EPSG:7856"').described
    assert described.declared_crs == "EPSG:7856"
    assert (described.declared_origin_easting_m, described.declared_origin_northing_m) == (332_000.0, 6_248_000.0)


def test_a_map_crs_without_any_position_is_refused() -> None:
    with pytest.raises(InputError, match="no fix and no anchor says where the map is"):
        converted('wheel_speeds = { time = "t", speed = "v" }', "t,v\n1,2\n", 'map_crs = "EPSG:7856"')


def test_without_a_map_crs_nothing_is_declared() -> None:
    part = 'fixes = { time = "t", lat = "lat", lon = "lon" }'
    assert drive_of_rows(part, "t,lat,lon\n1,-33.8886,151.1873\n").described.declared_crs == ""

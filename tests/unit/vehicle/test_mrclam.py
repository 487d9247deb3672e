"""The UTIAS multi-robot files become events of robots that see barcodes and one another."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from trigpoint.errors import InputError
from trigpoint.events.drives import drives_of
from trigpoint.events.observed import LandmarksDetected
from trigpoint.geodesy.projection import map_points_from_wgs84, pin_map_frame
from trigpoint_vehicle.core.mrclam import (
    BARCODES,
    CRS,
    LANDMARKS,
    ORIGIN,
    RobotSources,
    mrclam,
    robot_files,
    robot_numbers,
)
from trigpoint_vehicle.core.recording import Conversion
from trigpoint_vehicle.core.text_tables import SourceText
from trigpoint_vehicle.source_files import read_source

WORN = SourceText(BARCODES, "# Subject #    Barcode #\n  1 \t   5\n  2 \t  14\n  6 \t  63\n")
SURVEY = SourceText(LANDMARKS, "# head\n  6 \t 0.588 \t -4.282 \t 0.00004570 \t 0.00027395\n")
FRAME = pin_map_frame(crs=CRS, origin=ORIGIN)
ROBOT_1 = RobotSources(
    robot=1,
    odometry=SourceText("o1", "# head\n1248444187.156 \t 0.086 \t -0.398\n1248444187.186 \t 0.086 \t -0.398\n"),
    measurement=SourceText("m1", "1248444189.599 63 3.787 -0.257\n1248444189.599 14 6.8 -0.005\n"),
    truth=SourceText("t1", "1248444175.103 1.41 -3.89 2.2696\n1248444175.115 1.41 -3.88 2.2696\n"),
)
ROBOT_2 = replace(ROBOT_1, robot=2)


def converted(*robots: RobotSources) -> Conversion:
    return mrclam(robots, WORN, SURVEY)


def test_robots_are_found_by_their_files() -> None:
    assert robot_numbers(["Robot2_Odometry.dat", "Robot1_Measurement.dat", "Robotx.dat", BARCODES]) == (1, 2)


def test_commanded_motion_keeps_its_stamps_to_the_millisecond() -> None:
    (drive,) = drives_of(converted(ROBOT_1).recordings[0].rows)
    assert drive.wheels.stamp_ns.tolist() == [1248444187156000000, 1248444187186000000]
    assert (drive.wheels.speed_mps[0], drive.wheels.yaw_rate_radps[0]) == (0.086, -0.398)
    assert math.isnan(drive.wheels.steering_rad[0])


def test_a_sweep_names_landmarks_and_other_robots() -> None:
    (drive,) = drives_of(converted(ROBOT_1, ROBOT_2).recordings[0].rows)
    assert drive.detections.kind == ("barcode", "vehicle")
    assert drive.detections.signature == ("landmark-6", "robot2")
    assert len(set(drive.detections.sequence.tolist())) == 1


def test_a_barcode_nobody_wears_is_left_out_and_counted() -> None:
    misread = replace(ROBOT_1, measurement=SourceText("m1", "1248444189.599 43 3.8 0.1\n1248444189.7 63 3.8 0.1\n"))
    conversion = converted(misread)
    sweeps = [row.event for row in conversion.recordings[0].rows if isinstance(row.event, LandmarksDetected)]
    assert [len(sweep.detections) for sweep in sweeps] == [1]
    assert conversion.remarks == ("robot1: 1 sightings of barcodes nobody wears were left out",)


def test_surveyed_landmarks_are_anchors_no_better_than_a_millimetre() -> None:
    (anchor,) = converted(ROBOT_1).anchors
    assert (anchor.signature, anchor.image, anchor.sigma_m, anchor.image_sigma_m) == (
        "landmark-6",
        "survey",
        0.001,
        0.0,
    )
    point_m = map_points_from_wgs84(np.array([anchor.lat_deg]), np.array([anchor.lon_deg]), FRAME)[0]
    assert point_m == pytest.approx([0.588 * FRAME.point_scale, -4.282 * FRAME.point_scale], abs=1e-6)


def test_true_headings_are_those_of_the_local_frame() -> None:
    (path,) = converted(ROBOT_1).truth.paths
    # the local axes lie along the grid, so nothing turns; 1e-6 rad is a micrometre over the step of a metre
    assert path.heading_rad == pytest.approx([2.2696, 2.2696], abs=1e-6)


def test_a_barcode_that_is_no_number_is_refused_with_file_row_and_value() -> None:
    with pytest.raises(InputError, match="m1, row 1: barcode is 'six', not a whole number"):
        converted(replace(ROBOT_1, measurement=SourceText("m1", "1248444189.599 six 3.8 0.1\n")))


@pytest.fixture(scope="module")
def real_set(recorded_drives: Path) -> Conversion:
    folder = recorded_drives / "mrclam6"
    names = robot_files(1)
    odometry, measurement, truth = (read_source(folder, name) for name in names)
    robot = RobotSources(robot=1, odometry=odometry, measurement=measurement, truth=truth)
    return mrclam([robot], read_source(folder, BARCODES), read_source(folder, LANDMARKS))


@pytest.mark.data
def test_sightings_from_true_poses_meet_the_surveyed_landmarks(real_set: Conversion) -> None:
    (drive,), (path,) = drives_of(real_set.recordings[0].rows), real_set.truth.paths
    seen, pose_m = drive.detections, map_points_from_wgs84(path.lat_deg, path.lon_deg, FRAME)
    ours = np.array([name.startswith("landmark-") for name in seen.signature]) & (seen.stamp_ns < path.stamp_ns[-1])
    heading = np.interp(seen.stamp_ns, path.stamp_ns, np.unwrap(path.heading_rad)) + seen.bearing_rad
    x_m = np.interp(seen.stamp_ns, path.stamp_ns, pose_m[:, 0]) + seen.range_m * np.cos(heading)
    y_m = np.interp(seen.stamp_ns, path.stamp_ns, pose_m[:, 1]) + seen.range_m * np.sin(heading)
    mark = {one.signature: (one.lat_deg, one.lon_deg) for one in real_set.anchors}
    lat_deg, lon_deg = np.array([mark.get(name, (math.nan, math.nan)) for name in seen.signature])[ours].T
    off_m = np.column_stack([x_m, y_m])[ours] - map_points_from_wgs84(lat_deg, lon_deg, FRAME)
    assert float(np.median(np.hypot(*off_m.T))) < 0.15  # m: the sensor's own error; 0.08 was measured

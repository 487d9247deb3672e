"""A KITTI raw drive becomes fixes, inertial data, speeds, and sweeps whose points know when they were measured."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.events.codec import decode
from trigpoint.events.observed import GnssFixReceived, ImuMeasured, Observed, WheelSpeedMeasured
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.vehicle_log import read_vehicle_log
from trigpoint_vehicle.app import convert_kitti
from trigpoint_vehicle.cloud_conversion import WrittenClouds
from trigpoint_vehicle.core.kitti import (
    FIRST_STAMP_NS,
    FORWARD_SPEED,
    YAW,
    YAW_RATE,
    bin_points,
    even_stamps_ns,
    kitti_sweep,
    laser_of_point,
    lidar_mounting,
    oxts_rows,
    turn_ns,
    written_stamps_ns,
)
from trigpoint_vehicle.core.mountings import AT_BASE
from trigpoint_vehicle.core.text_tables import SourceText
from trigpoint_vehicle.kitti_files import kitti_drive

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

OXTS = "49.01 8.42 112.8 0.02 0 -1.2 -3.3 1.1 3.5 0.03 -0.03 0 0 0 0.7 0.3 9.9 0 0 0 0 0 0.14 0.49 0.06 4 10 4 4 0"
CALIBRATION = "Tr_imu_velo 1 0 0 -0.81 0 1 0 0.32 0 0 1 -0.80\n"
POINTS = np.array([[10.0, 0.0, 0.0], [0.0, 10.0, 1.0], [0.0, -10.0, 1.0]], dtype=np.float32)


def events_of(log: Path) -> list[tuple[int, Observed]]:
    return [(one.stamp_ns, decode(one.schema_name, one.payload)) for one in read_vehicle_log(log)]  # type: ignore[misc]


def sweeps_of(log: Path) -> Iterator[tuple[int, PointsScanned]]:
    for one in read_vehicle_log(log):
        if one.schema_name == "foxglove.PointCloud":
            event = decode(one.schema_name, one.payload)
            assert isinstance(event, PointsScanned)
            yield one.stamp_ns, event


def collected(folder: Path, *, scans: int = 2) -> Path:
    """A drive with an npz a scan."""
    (folder / "oxts").mkdir(parents=True)
    (folder / "oxts/oxts.txt").write_text(f"{OXTS}\n" * 4)
    (folder / "oxts/tracking_calib.txt").write_text(CALIBRATION)
    for number in range(scans):
        steps = np.rint(POINTS / 0.005).astype(np.int16)
        np.savez(folder / f"scan_{2 * number:04d}.npz", xyz_5mm=steps, intensity=np.array([1, 2, 3], dtype=np.uint8))
    return folder


def published(folder: Path) -> Path:
    """A drive as KITTI publishes it, the calibration in the folder above."""
    drive = folder / "drive_sync"
    for name in ("velodyne_points/data", "oxts/data"):
        (drive / name).mkdir(parents=True)
    (folder / "calib_imu_to_velo.txt").write_text("calib_time: x\nR: 1 0 0 0 1 0 0 0 1\nT: -0.81 0.32 -0.80\n")
    for number in range(2):
        rows = np.hstack([POINTS, np.full((3, 1), 0.25, dtype=np.float32)])
        (drive / f"velodyne_points/data/{number:010d}.bin").write_bytes(rows.tobytes())
        (drive / f"oxts/data/{number:010d}.txt").write_text(f"{OXTS}\n")
    stamps = "2011-09-26 13:02:25.500000001\n2011-09-26 13:02:25.600000001\n"
    (drive / "velodyne_points/timestamps.txt").write_text(stamps)
    (drive / "oxts/timestamps.txt").write_text(stamps)
    return drive


def test_a_collected_drive_has_a_fix_inertial_data_and_speed_a_row_and_every_scan(tmp_path: Path) -> None:
    written = convert_kitti(collected(tmp_path / "in"), tmp_path / "out")
    counts = {GnssFixReceived: 4, ImuMeasured: 4, WheelSpeedMeasured: 4, PointsScanned: 2}
    assert written.counts == {kind.__name__: count for kind, count in counts.items()}
    assert written.left_aside.complaints() == ()


def test_the_row_of_the_oxts_is_the_number_of_the_scan_at_10_hz(tmp_path: Path) -> None:
    written = convert_kitti(collected(tmp_path / "in"), tmp_path / "out")
    assert [stamp_ns - FIRST_STAMP_NS for stamp_ns, _ in sweeps_of(written.log)] == [0, 200_000_000]


def oxts_turning(step_s: float, *, yaw_sigma_rad: float = 0.0) -> Floats:
    """Rows of a car that turns to and fro, so far apart in time."""
    at_s = step_s * np.arange(150)
    rows = np.zeros((150, 30))
    rows[:, YAW] = 3.0 - np.cos(0.4 * at_s) + np.random.default_rng(1).normal(0.0, yaw_sigma_rad, 150)
    rows[:, YAW] = (rows[:, YAW] + np.pi) % (2.0 * np.pi) - np.pi
    rows[:, YAW_RATE] = 0.4 * np.sin(0.4 * at_s)
    return rows


def test_scans_without_times_are_as_far_apart_as_the_yaw_rate_adds_up_to_the_yaw() -> None:
    steps_ns = np.diff(even_stamps_ns(oxts_turning(0.1036, yaw_sigma_rad=1e-4)))
    assert steps_ns.min() == steps_ns.max() == pytest.approx(103_600_000, rel=2e-3)  # 0.1 mrad of 20 mrad a step


@pytest.mark.parametrize(
    "rows", [np.zeros((150, 30)), oxts_turning(0.1036, yaw_sigma_rad=0.05), oxts_turning(1.0), np.full((9, 30), np.nan)]
)
def test_they_are_nominally_apart_where_the_yaw_does_not_tell(rows: Floats) -> None:
    assert set(np.diff(even_stamps_ns(rows))) == {100_000_000}


@pytest.mark.data
def test_the_recorded_scans_are_103_6_ms_apart(recorded: WrittenClouds) -> None:
    stamps_ns = [stamp_ns for stamp_ns, _ in sweeps_of(recorded.log)]
    assert np.diff(stamps_ns) == pytest.approx(np.full(76, 207_200_000), rel=5e-3)  # by the lidar's odometry 206 to 208


def test_events_stand_in_order_of_time(tmp_path: Path) -> None:
    stamps = [stamp_ns for stamp_ns, _ in events_of(convert_kitti(collected(tmp_path / "in"), tmp_path / "out").log)]
    assert stamps == sorted(stamps)


def test_what_the_oxts_says_keeps_its_numbers(tmp_path: Path) -> None:
    events = [event for _, event in events_of(convert_kitti(collected(tmp_path / "in"), tmp_path / "out").log)]
    assert GnssFixReceived(lat_deg=49.01, lon_deg=8.42, height_m=112.8, sigma_m=0.49) in events
    assert ImuMeasured(yaw_rate_radps=0.14, acceleration_x_mps2=0.7, acceleration_y_mps2=0.3) in events
    assert [event.speed_mps for event in events if isinstance(event, WheelSpeedMeasured)] == [3.5] * 4


def test_a_published_drive_is_read_with_its_own_times_and_reflectances(tmp_path: Path) -> None:
    written = convert_kitti(published(tmp_path), tmp_path / "out")
    (first_ns, first), (second_ns, _) = sweeps_of(written.log)
    assert first_ns == 1_317_042_145_500_000_001  # 2011-09-26T13:02:25.500000001Z
    assert second_ns - first_ns == 100_000_000
    assert (first.intensity.tolist(), first.point_m.tolist()) == ([0.25] * 3, POINTS.tolist())


@pytest.mark.parametrize("text", [CALIBRATION, "R: 1 0 0 0 1 0 0 0 1\nT: -0.81 0.32 -0.80"])
def test_the_lidar_stands_where_the_calibration_says_over_the_road(text: str) -> None:
    mounting = lidar_mounting(SourceText("calib", text))
    assert mounting.position_m == pytest.approx([0.81, -0.32, 0.93 + 0.80])
    assert mounting.orientation.tolist() == [0.0, 0.0, 0.0, 1.0]


def test_a_turn_goes_clockwise_and_the_stamp_is_when_the_lidar_looks_ahead() -> None:
    sweep = kitti_sweep(POINTS, np.zeros(3, dtype=np.float32), AT_BASE, turn_ns=100_000_000)
    assert sweep.offset_ns.tolist() == [0, -25_000_000, 25_000_000]  # ahead, left, right


def test_the_next_laser_begins_where_the_azimuth_falls_back_to_ahead() -> None:
    turn_deg = np.linspace(1.0, 359.0, 20)
    azimuth_rad = np.radians([*turn_deg, *turn_deg, math.nan])
    assert laser_of_point(azimuth_rad).tolist() == [0] * 20 + [1] * 21


def test_an_azimuth_that_trembles_about_ahead_begins_one_laser() -> None:
    azimuth_rad = np.radians([*np.linspace(1.0, 359.0, 20), 0.1, -0.1, *np.linspace(0.2, 359.0, 20)])
    assert np.unique(laser_of_point(azimuth_rad)).tolist() == [0, 1]


def test_a_point_at_the_lidar_itself_did_not_come_back() -> None:
    points = np.vstack([POINTS, np.zeros((1, 3), dtype=np.float32)])
    sweep = kitti_sweep(points, np.zeros(4, dtype=np.float32), AT_BASE, turn_ns=100_000_000)
    assert np.isnan(sweep.point_m).all(axis=1).tolist() == [False, False, False, True]


def test_a_turn_takes_as_long_as_scans_that_follow_one_another_are_apart() -> None:
    assert turn_ns(np.array([100, 203, -1, 500, 604])) == 103


def test_a_scan_that_cannot_be_read_is_left_aside_and_the_others_are_written(tmp_path: Path) -> None:
    source = collected(tmp_path / "in")
    (source / "scan_0000.npz").write_bytes(b"no zip")
    written = convert_kitti(source, tmp_path / "out")
    assert (written.counts["PointsScanned"], dict(written.left_aside.counts)) == (1, {"unreadable scan": 1})
    assert "scan_0000.npz: no arrays xyz_5mm and intensity" in written.left_aside.complaints()[0]


def test_a_scan_of_half_a_point_is_left_aside(tmp_path: Path) -> None:
    drive = published(tmp_path)
    (drive / "velodyne_points/data/0000000001.bin").write_bytes(bytes(17))
    written = convert_kitti(drive, tmp_path / "out")
    assert dict(written.left_aside.counts) == {"unreadable scan": 1}
    assert "17 bytes are no whole number of points of 16 bytes" in written.left_aside.complaints()[0]


def test_a_scan_without_a_stamp_is_left_aside(tmp_path: Path) -> None:
    drive = published(tmp_path)
    (drive / "velodyne_points/timestamps.txt").write_text("2011-09-26 13:02:25.5\n\n")
    assert dict(convert_kitti(drive, tmp_path / "out").left_aside.counts) == {"scan without a stamp": 1}


def test_a_drive_without_oxts_is_refused_by_the_files_name(tmp_path: Path) -> None:
    source = collected(tmp_path / "in")
    (source / "oxts/oxts.txt").unlink()
    with pytest.raises(InputError, match=r"oxts/oxts.txt: cannot be read"):
        kitti_drive(source)


def test_a_drive_without_calibration_is_refused(tmp_path: Path) -> None:
    source = collected(tmp_path / "in")
    (source / "oxts/tracking_calib.txt").unlink()
    with pytest.raises(InputError, match="no calibration of the lidar"):
        kitti_drive(source)


def test_a_drive_without_scans_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no scan in it"):
        kitti_drive(collected(tmp_path / "in", scans=0))


def test_a_matrix_that_turns_nothing_is_refused() -> None:
    with pytest.raises(InputError, match="no rotation: R Rᵀ is 1 from 1, limit 0.001"):
        lidar_mounting(SourceText("calib", "R: 0 0 0 0 1 0 0 0 1\nT: 0 0 0"))


@pytest.mark.parametrize("text", ["R: 1 2 3", "R: 1 0 0 0 1 0 0 0 1\nT: 1 x 2"])
def test_a_calibration_of_other_numbers_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="calib: "):
        lidar_mounting(SourceText("calib", text))


def test_a_row_of_other_length_is_refused_with_its_number() -> None:
    with pytest.raises(InputError, match="oxts, row 2: 29 numbers, expected 30"):
        oxts_rows(SourceText("oxts", f"{OXTS}\n{OXTS.rsplit(' ', 1)[0]}\n"))


def test_a_line_that_is_no_time_is_refused_with_its_number() -> None:
    with pytest.raises(InputError, match="stamps, line 2: 'yesterday' is no time"):
        written_stamps_ns(SourceText("stamps", "2011-09-26 13:02:25.5\nyesterday\n"))


def test_an_empty_scan_has_no_points() -> None:
    points, reflectances = bin_points("scan", b"")
    assert (points.shape, reflectances.shape) == ((0, 3), (0,))


SEAM_RINGS = (17, 18, 19, 20)  # whose turn ends on surfaces behind the car
EDGE = 3  # points on either side that have to lie on one surface


def _seams(sweep: PointsScanned) -> Iterator[tuple[int, int, float]]:
    """Where the range jumps behind the car between two surfaces: ring, degree of azimuth, by how many metres to the
    right."""
    azimuth_deg = np.degrees(np.arctan2(sweep.point_m[:, 1], sweep.point_m[:, 0])) % 360.0
    range_m = np.hypot(sweep.point_m[:, 0], sweep.point_m[:, 1])
    for ring in SEAM_RINGS:
        rows = np.flatnonzero((sweep.ring == ring) & (np.abs(azimuth_deg - 180.0) < 8.0))
        for at in range(EDGE, len(rows) - EDGE):
            before, after = range_m[rows[at - EDGE : at]], range_m[rows[at : at + EDGE]]
            if 0.15 < abs(after[0] - before[-1]) < 1.2 and np.ptp(before) < 0.1 and np.ptp(after) < 0.1:
                yield ring, int(azimuth_deg[rows[at]]), float(after[0] - before[-1])


def _later_on_the_right_s(sweep: PointsScanned) -> float:
    """By how much a point behind the car on the right is said to be later than one on the left."""
    azimuth_rad = np.arctan2(sweep.point_m[:, 1], sweep.point_m[:, 0])
    right, left = int(np.nanargmin(azimuth_rad)), int(np.nanargmax(azimuth_rad))
    return (int(sweep.offset_ns[right]) - int(sweep.offset_ns[left])) / 1e9


@pytest.fixture(scope="module")
def recorded(recorded_drives: Path, tmp_path_factory: pytest.TempPathFactory) -> WrittenClouds:
    return convert_kitti(recorded_drives / "kitti_0005", tmp_path_factory.mktemp("kitti"))


@pytest.mark.data
def test_surfaces_over_the_seam_of_a_turn_are_apart_by_what_the_car_drove_in_it(
    recorded_drives: Path, recorded: WrittenClouds
) -> None:
    source = recorded_drives / "kitti_0005"
    speed_mps = np.loadtxt(source / "oxts/oxts.txt")[:, FORWARD_SPEED]
    found: dict[int, list[tuple[int, float]]] = {ring: [] for ring in SEAM_RINGS}
    for (_, sweep), speed in zip(sweeps_of(recorded.log), speed_mps[::2], strict=True):  # every second scan is there
        for ring, degree, jump_m in _seams(sweep):
            found[ring].append((degree, jump_m / speed - _later_on_the_right_s(sweep)))
    medians_s = []
    for seams in found.values():
        degrees = [degree for degree, _ in seams]
        seam = max(set(degrees), key=degrees.count)  # each laser's own: they look to either side of the head
        medians_s.append(float(np.median([wrong_s for degree, wrong_s in seams if abs(degree - seam) <= 1])))
    assert medians_s == pytest.approx([0.0] * len(SEAM_RINGS), abs=0.04)  # s: a turn the other way is 0.2 s off


@pytest.mark.data
def test_every_scan_of_the_recorded_drive_has_64_lasers(recorded: WrittenClouds) -> None:
    lasers = {int(sweep.ring.max()) + 1 for _, sweep in sweeps_of(recorded.log)}
    assert (recorded.counts["PointsScanned"], lasers) == (77, {64})

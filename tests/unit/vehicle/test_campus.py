"""What the simulated campus promises: the paper's circumstances, truth kept apart, the same seed the same world."""

import math
from dataclasses import replace

import numpy as np
import pytest

from trigpoint.errors import InputError
from trigpoint.events.drives import Drive, drives_of
from trigpoint.events.observed import GnssFixReceived, LandmarksDetected, VehicleDescribed
from trigpoint.geodesy.poses import transform_points
from trigpoint.geodesy.projection import map_points_from_wgs84
from trigpoint_vehicle.core.campus import Campus, simulate_campus
from trigpoint_vehicle.core.campus_settings import (
    CampusSettings,
    ImuSettings,
    RouteSettings,
    with_gnss_only,
    with_plan,
    without_gnss,
)
from trigpoint_vehicle.core.streets import quadrangle_box_m

SHORT = CampusSettings(vehicles=1, route=RouteSettings(plan="straight", straight_length_m=150.0))


def drives(campus: Campus) -> tuple[Drive, ...]:
    return drives_of(row for recording in campus.recordings for row in recording.rows)


def fix_errors_m(campus: Campus, vehicle_index: int) -> np.ndarray:
    fixes, true = drives(campus)[vehicle_index].fixes, campus.truth.fixes[vehicle_index]
    measured_m = map_points_from_wgs84(fixes.lat_deg, fixes.lon_deg, campus.frame)
    return measured_m - map_points_from_wgs84(true.lat_deg, true.lon_deg, campus.frame)


def in_state(campus: Campus, vehicle_index: int, state: str) -> np.ndarray:
    return np.array([one == state for one in campus.truth.fixes[vehicle_index].state])


def label_points_m(campus: Campus) -> np.ndarray:
    lat_deg, lon_deg = (np.array([getattr(a, name) for a in campus.anchors]) for name in ("lat_deg", "lon_deg"))
    return map_points_from_wgs84(lat_deg, lon_deg, campus.frame)


def test_the_same_seed_gives_the_same_events_and_truth() -> None:
    plain = with_plan(SHORT, "straight")
    first, again = simulate_campus(3, plain), simulate_campus(3, plain)
    assert [repr(r.rows) for r in first.recordings] == [repr(r.rows) for r in again.recordings]
    assert first.anchors == again.anchors


def test_another_seed_is_another_campus_and_another_boot() -> None:
    plain = with_plan(SHORT, "straight")
    first, other = simulate_campus(3, plain), simulate_campus(4, plain)
    assert first.recordings[0].rows[0].identity.boot_id != other.recordings[0].rows[0].identity.boot_id
    assert not np.array_equal(first.landmarks.position_m, other.landmarks.position_m)


def test_another_imu_leaves_every_other_sensor_as_it_was() -> None:
    plain = with_plan(SHORT, "straight")
    noisier = replace(plain, imu=ImuSettings(white_radps=0.1))
    before, after = (drives(simulate_campus(3, settings))[0] for settings in (plain, noisier))
    assert np.array_equal(before.fixes.lat_deg, after.fixes.lat_deg)
    assert np.array_equal(before.wheels.speed_mps, after.wheels.speed_mps)
    assert np.array_equal(before.detections.range_m, after.detections.range_m)
    assert not np.array_equal(before.imu.yaw_rate_radps, after.imu.yaw_rate_radps)


def test_events_are_numbered_from_0_in_order_of_time_after_the_description(campus: Campus) -> None:
    rows = campus.recordings[0].rows
    assert isinstance(rows[0].event, VehicleDescribed)
    assert [row.identity.sequence for row in rows] == list(range(len(rows)))
    assert np.all(np.diff([row.stamp_ns for row in rows]) >= 0)


def test_vehicles_drive_loops_of_4_to_5_km_at_5_to_8_metres_a_second(campus: Campus) -> None:
    lengths_m = [float(np.hypot(*np.diff(m.pose[:, :2], axis=0).T).sum()) for m in campus.motions]
    # corners are rounded, which cuts up to 5 % off the streets' 4 to 5 km
    assert all(3800.0 <= length_m <= 5000.0 for length_m in lengths_m)
    ends_m = [float(np.hypot(*(m.pose[-1, :2] - m.pose[0, :2]))) for m in campus.motions]
    assert max(ends_m) < 15.0  # back at the junction they left, in the other street's lane at most
    cruising = np.concatenate([m.speed_mps[m.time_s > 60.0] for m in campus.motions])
    assert np.percentile(cruising, 10) > 4.9
    assert cruising.max() < 8.05  # 8 m/s and what smoothing overshoots


def test_no_bend_is_sharper_than_a_car_can_drive(campus: Campus) -> None:
    motion = campus.motions[0]
    fast = motion.speed_mps > 1.0
    curvature = np.abs(motion.yaw_rate_radps[fast] / motion.speed_mps[fast])
    assert curvature.max() < 1.0 / 4.0  # a small car turns in 4 to 5 m


def test_sensors_come_at_50_100_1_and_5_hertz(campus: Campus) -> None:
    drive = drives(campus)[0]
    sweeps = [row.stamp_ns for row in campus.recordings[0].rows if isinstance(row.event, LandmarksDetected)]
    series = (drive.wheels.stamp_ns, drive.imu.stamp_ns, drive.fixes.stamp_ns, np.array(sweeps))
    assert [round(1e9 / float(np.median(np.diff(stamps)))) for stamps in series] == [50, 100, 1, 5]


def test_500_landmarks_stand_clear_of_where_vehicles_pass(campus: Campus) -> None:
    position_m = campus.landmarks.position_m
    track_m = np.vstack([motion.pose[::20, :2] for motion in campus.motions])
    nearest_m = min(float(np.hypot(*(track_m - point).T).min()) for point in position_m)
    assert len(position_m) == 500
    assert nearest_m > 2.4  # 2.5 m from the points asked about, 1 m apart


def test_some_poles_stand_in_pairs_1_5_metres_apart(campus: Campus) -> None:
    poles = campus.landmarks.position_m[: campus.landmarks.kind.count("pole")]
    apart_m = np.hypot(*(poles[:, None] - poles[None]).transpose(2, 0, 1))
    pairs = (apart_m > 0.0) & (apart_m < 1.6)
    assert pairs.sum() == 2 * CampusSettings().landmarks.pair_count


def test_vehicles_share_most_landmarks_but_not_all(campus: Campus) -> None:
    seen = [set(s.landmark[s.landmark >= 0].tolist()) for s in campus.sightings]
    shared = len(seen[0] & seen[1]) / len(seen[0] | seen[1])
    assert 0.5 < shared < 0.95


def test_detections_are_under_30_metres_with_clutter_among_them(campus: Campus) -> None:
    seen = campus.sightings[0]
    assert seen.range_m.max() < 30.0
    assert 0.01 < (seen.landmark < 0).mean() < 0.15


def test_a_landmark_in_reach_is_missed_now_and_then(campus: Campus) -> None:
    expected = CampusSettings().sweeps.detection_probability
    pose, point_m = campus.motions[0].pose[::20], campus.landmarks.position_m
    near = sum(int((np.hypot(*(point_m - p[:2]).T) < 28.0).sum()) for p in pose)
    assert 0.5 < (campus.sightings[0].landmark >= 0).sum() / near < expected


def test_detections_and_labels_do_not_say_of_what_they_are(campus: Campus) -> None:
    assert set(drives(campus)[0].detections.signature) == {""}
    assert {anchor.signature for anchor in campus.anchors} == {""}
    assert {anchor.anchor for anchor in campus.anchors}.isdisjoint(campus.landmarks.name)


def test_exact_sensors_see_landmarks_where_they_are(exact_campus: Campus) -> None:
    drive, frame = drives(exact_campus)[0], exact_campus.frame
    motion, seen = exact_campus.motions[0], drive.detections
    at = np.rint((seen.stamp_ns - drive.imu.stamp_ns[0]) * 1e-7).astype(int)
    ahead_m = drive.described.landmark_sensor_x_m + seen.range_m * np.cos(seen.bearing_rad)
    left_m = drive.described.landmark_sensor_y_m + seen.range_m * np.sin(seen.bearing_rad)
    placed_m = transform_points(motion.pose[at], frame.point_scale * np.column_stack([ahead_m, left_m]))
    number = [exact_campus.landmarks.name.index(name) for name in seen.signature]
    # rounding of stamps to the motion's 10 ms is exact at 1 Hz: only float64 is left
    assert np.abs(placed_m - exact_campus.landmarks.position_m[number]).max() < 1e-6


def test_exact_fixes_are_the_antenna_and_not_the_base(exact_campus: Campus) -> None:
    drive, motion = drives(exact_campus)[0], exact_campus.motions[0]
    fix_m = map_points_from_wgs84(drive.fixes.lat_deg, drive.fixes.lon_deg, exact_campus.frame)
    arm_m = np.tile([drive.described.antenna_x_m, drive.described.antenna_y_m], (len(fix_m), 1))
    antenna_m = transform_points(motion.pose[::100][: len(fix_m)], exact_campus.frame.point_scale * arm_m)
    assert np.abs(fix_m - antenna_m).max() < 1e-6  # WGS84 and back


def test_exact_wheels_measure_the_ground_and_not_the_grid(exact_campus: Campus) -> None:
    drive, motion = drives(exact_campus)[0], exact_campus.motions[0]
    grid_m = float(np.hypot(*np.diff(motion.pose[:, :2], axis=0).T).sum())
    ground_m = float(np.trapezoid(drive.wheels.speed_mps, drive.wheels.stamp_ns * 1e-9))
    # 10 Hz samples of a smooth speed: better than 10 ppm, where grid and ground differ by 55 ppm
    assert ground_m * exact_campus.frame.point_scale == pytest.approx(grid_m, rel=1e-5)
    assert abs(exact_campus.frame.point_scale - 1.0) > 3e-5


def test_exact_yaw_rates_add_up_to_the_heading(exact_campus: Campus) -> None:
    drive, motion = drives(exact_campus)[0], exact_campus.motions[0]
    turned_rad = float(np.trapezoid(drive.imu.yaw_rate_radps, drive.imu.stamp_ns * 1e-9))
    assert turned_rad == pytest.approx(motion.pose[-1, 2] - motion.pose[0, 2], abs=1e-3)  # rad, of 10 or more


def test_clear_fixes_err_by_white_noise_and_a_slow_bias(campus: Campus) -> None:
    errors_m = np.vstack([fix_errors_m(campus, index)[in_state(campus, index, "clear")] for index in (0, 1)])
    # sqrt(1.5^2 + 2.5^2) = 2.9 m; a drive holds but three correlation times of the bias
    assert 1.6 < errors_m.std() < 4.2
    steps_m = np.diff(errors_m, axis=0)
    assert 1.4 < np.median(np.abs(steps_m)) / 0.6745 / math.sqrt(2.0) < 1.65  # the white part alone


def test_car_park_fixes_are_90_and_none_is_near(campus: Campus) -> None:
    lost = in_state(campus, 0, "car park")
    distance_m = np.hypot(*fix_errors_m(campus, 0)[lost].T)
    assert lost.sum() == 90
    assert distance_m.min() > 40.0
    assert distance_m.max() > 1000.0


def test_a_part_of_the_car_park_fixes_agree_on_a_wrong_place(campus: Campus) -> None:
    errors_m = fix_errors_m(campus, 0)[in_state(campus, 0, "car park")]
    close = np.hypot(*np.diff(errors_m, axis=0).T) < 10.0
    assert close.sum() >= 15  # of 20 s at 1 Hz


def test_multipath_shifts_fixes_by_5_to_30_metres(campus: Campus) -> None:
    distance_m = np.hypot(*fix_errors_m(campus, 0)[in_state(campus, 0, "multipath")].T)
    assert len(distance_m) >= 20
    # with white noise and bias on top, each rarely beyond 9 m
    assert 3.0 < float(np.median(distance_m)) < 40.0


def test_50_poles_are_labelled_30_of_them_in_the_quadrangle_and_one_image(campus: Campus) -> None:
    low, high = quadrangle_box_m(campus.streets, CampusSettings().streets.quadrangle_margin_m)
    true = [campus.landmarks.name.index(label.landmark) for label in campus.truth.labels]
    point_m = campus.landmarks.position_m[true]
    inside = ((point_m >= low) & (point_m <= high)).all(axis=1)
    assert len(campus.anchors) == 50
    assert inside.sum() >= 30  # one beside it may stand in the box but over the image's edge
    assert len({campus.anchors[index].image for index in range(30)}) == 1
    assert len({anchor.image for anchor in campus.anchors}) == 6


def test_labels_are_off_by_their_image_and_by_10_centimetres(campus: Campus) -> None:
    true = [campus.landmarks.name.index(label.landmark) for label in campus.truth.labels]
    image = [campus.imagery.image.index(anchor.image) for anchor in campus.anchors]
    left_m = label_points_m(campus) - campus.landmarks.position_m[true] - campus.imagery.offset_m[image]
    assert 0.07 < left_m.std() < 0.13  # 100 draws of 1-sigma 0.10 m
    assert campus.imagery.offset_m.shape == (6, 2)


def test_exact_labels_are_the_landmarks_and_say_so(exact_campus: Campus) -> None:
    true = [exact_campus.landmarks.name.index(anchor.signature) for anchor in exact_campus.anchors]
    off_m = label_points_m(exact_campus) - exact_campus.landmarks.position_m[true]
    assert np.abs(off_m).max() < 1e-6  # WGS84 and back


def test_a_campus_without_receivers_has_no_fix_but_a_declared_place() -> None:
    rows = simulate_campus(3, without_gnss(with_plan(SHORT, "straight"))).recordings[0].rows
    described = rows[0].event
    assert isinstance(described, VehicleDescribed)
    assert described.declared_crs == "EPSG:32756"
    assert not any(isinstance(row.event, GnssFixReceived) for row in rows)


def test_a_campus_with_receivers_only_has_nothing_but_fixes() -> None:
    rows = simulate_campus(3, with_gnss_only(with_plan(SHORT, "straight"))).recordings[0].rows
    assert {type(row.event) for row in rows} == {VehicleDescribed, GnssFixReceived}


def test_a_standing_vehicle_never_moves() -> None:
    campus = simulate_campus(3, with_plan(SHORT, "standing"))
    assert np.ptp(campus.motions[0].pose, axis=0).max() == 0.0
    assert drives(campus)[0].wheels.speed_mps.max() == 0.0


def test_a_straight_drive_is_nearly_straight() -> None:
    pose = simulate_campus(3, with_plan(SHORT, "straight")).motions[0].pose
    spread = np.linalg.svd(pose[:, :2] - pose[:, :2].mean(axis=0), compute_uv=False)
    assert spread[1] / spread[0] < 0.02


def test_drives_apart_never_come_near_one_another() -> None:
    settings = with_plan(CampusSettings(route=RouteSettings(length_min_m=1000.0)), "apart")
    first, second = (motion.pose[::100, :2] for motion in simulate_campus(3, settings).motions)
    assert np.hypot(*(first[:, None] - second[None]).transpose(2, 0, 1)).min() > 100.0


def test_a_plan_nobody_knows_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="plan 'sideways' is none of loop"):
        simulate_campus(1, with_plan(SHORT, "sideways"))


def test_a_loop_that_fits_no_street_is_refused_with_its_length() -> None:
    settings = CampusSettings(route=RouteSettings(length_min_m=10.0, length_max_m=20.0))
    with pytest.raises(InputError, match="no loop of 10 to 20 m"):
        simulate_campus(1, settings)

"""A whole drive is followed wherever its data allow it, and refused with the reason where they do not."""

from dataclasses import replace

import numpy as np
import pytest

from driven_paths.examples import FRAME, START_NS, Course, Driven, driven
from trigpoint.geodesy.poses import wrap_angles_rad
from trigpoint_filtering.core.track import FilteredDrive, filter_drive
from trigpoint_filtering.settings import FilterSettings

SETTINGS = FilterSettings()


def filtered_of(run: Driven) -> FilteredDrive:
    return filter_drive(run.drive, FRAME, SETTINGS)


def position_error_m(run: Driven, filtered: FilteredDrive) -> np.ndarray:
    error: np.ndarray = np.hypot(*(filtered.pose - run.pose_at(filtered.stamp_ns))[:, :2].T)
    return error


@pytest.mark.parametrize("turns_by", ["imu", "steering", "wheels"])
def test_a_drive_is_followed_by_whatever_tells_its_turns(turns_by: str) -> None:
    run = driven(Course(turns_by=turns_by))
    filtered = filtered_of(run)
    # Fixes are white, 1 m: averaged over some ten of them 0.3 m an axis are left; 1 m is three times that.
    assert np.median(position_error_m(run, filtered)) < 1.0
    assert filtered.refusal == ""


@pytest.mark.parametrize("heading_rad", np.linspace(-3.0, 3.0, 5))
def test_the_heading_is_found_whichever_way_the_drive_begins(heading_rad: float) -> None:
    run = driven(Course(heading_rad=heading_rad, duration_s=60.0))
    filtered = filtered_of(run)
    error_rad = wrap_angles_rad(filtered.pose[:, 2] - run.pose_at(filtered.stamp_ns)[:, 2])
    # Initialised within 0.3 rad (1 sigma), a tenth of that after a minute.
    assert abs(error_rad[0]) < 0.9
    assert abs(error_rad[-1]) < 0.1


def test_wrong_wheels_and_steering_are_calibrated_while_driving() -> None:
    run = driven(Course(turns_by="steering", speed_scale=1.04, steering_scale=1.06, duration_s=300.0))
    calibration = filtered_of(run).calibration
    # 1.8 km against a metre of noise fixes a scale to well under a percent; the steering's within two.
    assert calibration.mean[0] == pytest.approx(1.04, abs=0.005)
    assert calibration.mean[1] == pytest.approx(1.06, abs=0.02)


def test_calibrated_dead_reckoning_bridges_stretches_without_fixes() -> None:
    run = driven(Course(turns_by="steering", speed_scale=1.04, steering_scale=1.06, duration_s=300.0))
    withheld = run.fix_s() % 60.0 > 40.0
    filtered = filtered_of(run.with_fixes(~withheld))
    alone = (filtered.stamp_ns - START_NS) * 1e-9 % 60.0 > 40.0
    # 120 m of way: 4 % of wrong speed alone would be 5 m off at the end, 6 % of wrong steering more.
    assert np.median(position_error_m(run, filtered)[alone][-400:]) < 2.5


def test_a_gyroscopes_bias_is_found() -> None:
    filtered = filtered_of(driven(Course(yaw_bias_radps=0.008)))
    # A bias of b turns the path by b t: over 100 s 0.5 mrad/s would show as 15 m.
    assert filtered.calibration.mean[2] == pytest.approx(0.008, abs=0.0005)


def test_the_antennas_lever_arm_is_part_of_the_pose() -> None:
    run = driven(Course(white_m=0.05, turn_radps=0.4))
    filtered = filtered_of(run)
    # Taking the antenna for the base would leave its 1.55 m as error; the GNSS bias's prior leaves a third of it.
    assert np.median(position_error_m(run, filtered)[600:]) < 0.5


def test_covariance_covers_the_error_of_correlated_fixes() -> None:
    run = driven(Course(duration_s=400.0))
    bias_m = 1.7 * np.column_stack([np.sin(run.fix_s() / 90.0), np.cos(run.fix_s() / 70.0)])
    noise_m = np.random.default_rng(2).normal(0.0, 1.0, bias_m.shape)
    filtered = filtered_of(run.with_shift(bias_m + noise_m, np.ones(len(bias_m), dtype=np.bool_)))
    error_m = (filtered.pose - run.pose_at(filtered.stamp_ns))[:, :2]
    nees = np.einsum("ni,nij,nj->n", error_m, np.linalg.inv(filtered.covariance[:, :2, :2]), error_m)
    # Two degrees of freedom: 2 is calibrated; far above is the overconfidence of fixes taken as independent.
    assert 0.1 < float(np.mean(nees)) < 4.0


def test_innovations_are_as_large_as_they_claim() -> None:
    filtered = filtered_of(driven(Course(white_m=1.1)))
    nis = np.array([verdict.nis for verdict in filtered.judged if np.isfinite(verdict.nis)])
    # White share 0.55 of a declared 2 m is 1.1 m: the mean of 190 values of 2 degrees of freedom is 2 +- 0.3.
    assert 1.2 < float(np.mean(nis)) < 2.6


def test_every_fix_gets_its_verdict_in_order() -> None:
    run = driven(Course(duration_s=60.0))
    assert [verdict.fix_sequence for verdict in filtered_of(run).judged] == run.drive.fixes.sequence.tolist()


def test_stamps_of_poses_rise_strictly() -> None:
    assert np.all(np.diff(filtered_of(driven(Course(duration_s=60.0))).stamp_ns) > 0)


def test_prediction_keeps_to_its_rate_however_fast_the_imu_is() -> None:
    run = driven(Course(duration_s=60.0))
    stamp_ns = np.arange(run.drive.imu.stamp_ns[0], run.drive.imu.stamp_ns[-1], 5_000_000)
    yaw_rate = np.interp(stamp_ns, run.drive.imu.stamp_ns, run.drive.imu.yaw_rate_radps)
    fast = replace(run.drive, imu=replace(run.drive.imu, stamp_ns=stamp_ns, yaw_rate_radps=yaw_rate))
    # 5 Hz and one more a fix.
    assert len(filter_drive(fast, FRAME, SETTINGS).stamp_ns) <= 60 * 6


def test_a_drive_without_fixes_has_no_pose_and_says_so() -> None:
    run = driven(Course(duration_s=60.0))
    filtered = filtered_of(run.with_fixes(np.zeros(60, dtype=np.bool_)))
    assert (len(filtered.pose), filtered.refusal) == (0, "no fixes")


def test_a_drive_that_never_moves_has_no_heading_and_says_so() -> None:
    filtered = filtered_of(driven(Course(speed_mps=0.0, duration_s=60.0)))
    assert len(filtered.pose) == 0
    assert "fixes along the way" in filtered.refusal
    assert not any(verdict.accepted for verdict in filtered.judged)


def test_a_drive_whose_turns_nothing_tells_is_refused() -> None:
    filtered = filtered_of(driven(Course(turns_by="nothing", duration_s=60.0)))
    assert filtered.refusal == "no wheel speed with a yaw rate"


def test_a_fix_the_projection_cannot_reach_is_rejected_alone() -> None:
    run = driven(Course(duration_s=60.0))
    lat_deg = run.drive.fixes.lat_deg.copy()
    lat_deg[40] = 91.0
    filtered = filter_drive(replace(run.drive, fixes=replace(run.drive.fixes, lat_deg=lat_deg)), FRAME, SETTINGS)
    assert [verdict.accepted for verdict in filtered.judged[39:42]] == [True, False, True]


def test_silent_wheels_lose_the_position_until_it_is_found_again() -> None:
    run = driven(Course(duration_s=150.0))
    seconds = (run.drive.wheels.stamp_ns - run.drive.wheels.stamp_ns[0]) * 1e-9
    heard = (seconds < 50.0) | (seconds > 90.0)
    wheels = run.drive.wheels
    gap = replace(
        run.drive,
        wheels=replace(
            wheels,
            stamp_ns=wheels.stamp_ns[heard],
            speed_mps=wheels.speed_mps[heard],
            steering_rad=wheels.steering_rad[heard],
            yaw_rate_radps=wheels.yaw_rate_radps[heard],
        ),
    )
    filtered = filter_drive(gap, FRAME, SETTINGS)
    reasons = [verdict.reason for verdict in filtered.judged]
    assert reasons.count("initialised") == 2
    assert position_error_m(run, filtered)[-1] < 3.0  # m: some twenty fixes of 1 m


def test_the_same_drive_twice_gives_the_same_to_the_last_bit() -> None:
    run = driven(Course(duration_s=60.0))
    np.testing.assert_array_equal(filtered_of(run).pose, filtered_of(run).pose)

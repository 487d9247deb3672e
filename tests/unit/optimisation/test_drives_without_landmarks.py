"""Odometry and fixes alone: calibrated, placed from any heading, or refused by name."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from driven_paths.examples import ANTENNA_M, FRAME, Course, Driven, driven
from trigpoint.errors import AlignmentRefused
from trigpoint.geodesy.poses import wrap_angles_rad
from trigpoint_optimisation.core.stages import Solved, solve_fleet
from trigpoint_optimisation.settings import Method, OdometrySettings, SolveSettings

Floats = NDArray[np.float64]

COURSE = Course(duration_s=120.0, white_m=0.5)


def solved(world: Driven, *, method: Method = "loose") -> Solved:
    settings = SolveSettings(
        method=method, edges="honest", odometry=OdometrySettings(keyframe_m=12.0)
    )  # coarse: a sixth of the time
    return solve_fleet([world.drive], [], FRAME, settings)


def errors(world: Driven, found: Solved) -> Floats:
    """Keyframes minus the truth (n, 3): m and rad."""
    error = found.state.drives[0].pose - world.pose_at(found.fleet.prepared[0].stamp_ns)
    error[:, 2] = wrap_angles_rad(error[:, 2])
    return error


def test_steering_and_speed_scale_are_found() -> None:
    course = replace(COURSE, turns_by="steering", steering_scale=1.06, speed_scale=1.03, duration_s=200.0)
    scale = solved(driven(course)).state.drives[0].scale
    assert scale[0] == pytest.approx(1.03 * FRAME.point_scale, abs=0.003)  # 200 fixes of 0.5 m along 1200 m
    assert scale[1] == pytest.approx(1.06, abs=0.01)  # of a prior of 0.10


def test_a_gyroscopes_bias_is_found() -> None:
    bias = solved(driven(replace(COURSE, yaw_bias_radps=0.004))).state.drives[0].turn_bias
    np.testing.assert_allclose(bias, 0.004, atol=0.0003)  # rad/s: 0.02 rad in a minute


def test_a_lever_arm_described_wrongly_is_corrected() -> None:
    world = driven(replace(COURSE, duration_s=200.0))
    described = replace(world.drive.described, antenna_x_m=float(ANTENNA_M[0]), antenna_y_m=-0.2)
    arm_m = solved(replace(world, drive=replace(world.drive, described=described))).state.drives[0].antenna_m
    assert abs(arm_m[1] - ANTENNA_M[1]) < 0.3  # m: half of the 0.6 m and more, against a prior of 0.3 m


@pytest.mark.parametrize("heading_rad", [0.0, 1.95, -2.6])  # 1.95 rad is 112 degrees
def test_the_heading_at_the_start_does_not_matter(heading_rad: float) -> None:
    world = driven(replace(COURSE, heading_rad=heading_rad))
    error = errors(world, solved(world))
    assert np.hypot(*error[:, :2].T).max() < 1.0  # m: fixes of 0.5 m and their possible slow error
    assert np.abs(error[:, 2]).max() < 0.02  # rad


def test_a_coherent_wrong_cluster_after_an_outage_does_not_capture_the_path() -> None:
    world = driven(replace(COURSE, duration_s=300.0))
    at_s = world.fix_s()
    after = world.with_fixes((at_s < 80.0) | (at_s > 180.0))
    wrong = (after.fix_s() > 180.0) & (after.fix_s() <= 200.0)
    found = solved(after.with_shift(np.array([700.0, 0.0]), wrong))
    assert not found.fleet.trusted[0][wrong].any()
    assert np.hypot(*errors(world, found)[:, :2].T).max() < 5.0  # m: 600 m of dead reckoning in the outage


def test_a_drive_without_fixes_is_refused_by_name() -> None:
    world = driven(COURSE)
    with pytest.raises(AlignmentRefused, match="vehicle car, drive boot: 0 fixes match the path: at least 3"):
        solved(world.with_fixes(np.zeros(len(world.drive.fixes.stamp_ns), dtype=bool)))


def test_a_standing_drive_is_refused_by_name() -> None:
    with pytest.raises(AlignmentRefused, match="vehicle car, drive boot: no two fixes 12 to 60 m apart"):
        solved(driven(replace(COURSE, speed_mps=0.0)))


def test_a_straight_drive_cannot_be_aligned_as_a_rigid_body() -> None:
    with pytest.raises(AlignmentRefused, match="car: nearly straight: the path's eigenvalue ratio is"):
        solved(driven(replace(COURSE, turn_radps=0.0)), method="rigid")

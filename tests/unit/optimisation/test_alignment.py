"""A path finds its place in the map by its fixes, from no first guess, or it is refused with the reason."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from trigpoint.errors import AlignmentRefused
from trigpoint.geodesy.poses import transform_points, wrap_angles_rad
from trigpoint_optimisation.core.alignment import (
    bent_alignment,
    consistent_fixes,
    rigid_alignment,
    turned_path,
    weighted_rigid,
)

Floats = NDArray[np.float64]

ARM_M = np.array([1.5, 0.4])
HEADINGS = st.floats(-math.pi, math.pi)
SHEAR = math.radians(112.0)  # how wrong a start yaw is that once sheared a map


def bow(count: int = 200, *, spacing_m: float = 3.0) -> Floats:
    """Poses (n, 3) along a road that swings from left to right, `spacing_m` apart."""
    heading = 0.8 * np.sin(np.arange(count) * spacing_m / 60.0)
    step = spacing_m * np.column_stack([np.cos(heading), np.sin(heading)])
    return np.column_stack([np.cumsum(step, axis=0), heading])


def path_lengths(pose: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(pose[:, :2], axis=0).T))])


def placed(T_map_path: Floats, pose: Floats) -> Floats:
    return np.column_stack([transform_points(T_map_path, pose[:, :2]), pose[:, 2] + T_map_path[2]])


@settings(deadline=None)
@given(HEADINGS, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_a_rigid_alignment_recovers_any_motion(heading_rad: float, x_m: float, y_m: float) -> None:
    point, T_map_path = bow()[:, :2], np.array([x_m, y_m, heading_rad])
    found = rigid_alignment(point, transform_points(T_map_path, point), sigma_m=2.0)
    np.testing.assert_allclose(found.residual_m, 0.0, atol=1e-9)  # m, rounding at 1 km
    assert math.cos(found.T_map_path.heading_rad - heading_rad) == pytest.approx(1.0, abs=1e-12)  # rounding


def test_a_rigid_alignment_works_at_sydneys_northing() -> None:
    point = bow()[:, :2]
    found = rigid_alignment(point, point + (333_000.0, 6_248_000.0), sigma_m=2.0)
    np.testing.assert_allclose(found.residual_m, 0.0, atol=1e-7)  # m: float64 steps of 1e-9, summed over 200


def test_a_third_of_wild_fixes_does_not_move_a_rigid_alignment() -> None:
    rng, point = np.random.default_rng(3), bow()[:, :2]
    fix = point + rng.normal(0.0, 1.0, point.shape)
    fix[::3] += (300.0, -200.0)
    found = rigid_alignment(point, fix, sigma_m=1.0)
    # m: 134 fixes of 1 m leave 0.1 m, the wild ones' Cauchy weights pull a few decimetres
    assert np.median(np.hypot(*(fix - found.residual_m - point).T)) < 0.5


def test_a_weightless_point_has_no_say() -> None:
    point = bow(20)[:, :2]
    to = point + (5.0, 7.0)
    to[4] += 1e3
    found = weighted_rigid(point, to, (np.arange(20) != 4).astype(np.float64))
    assert (found.x_m, found.y_m, found.heading_rad) == pytest.approx((5.0, 7.0, 0.0), abs=1e-9)  # rounding


def test_the_heading_of_an_alignment_is_as_sure_as_it_says() -> None:
    rng, point = np.random.default_rng(5), bow()[:, :2]
    found = [rigid_alignment(point, point + rng.normal(0.0, 2.0, point.shape), sigma_m=2.0) for _ in range(60)]
    spread = np.std([one.T_map_path.heading_rad for one in found])
    # 60 draws know a sigma to 9 %; robust weights cost some more
    assert spread == pytest.approx(found[0].heading_sigma_rad, rel=0.35)


def test_a_nearly_straight_path_is_refused_with_its_ratio_and_the_limit() -> None:
    straight = np.column_stack([np.linspace(0.0, 1000.0, 100), 0.5 * np.sin(np.arange(100.0))])
    with pytest.raises(AlignmentRefused, match=r"nearly straight.*ratio is \d\.\d+e-0\d, at least 1e-03"):
        rigid_alignment(straight, straight, sigma_m=2.0)


def test_straightness_is_a_ratio_whatever_the_size_of_the_path() -> None:
    # 100 km long and 40 m wide: its width alone would pass any absolute epsilon.
    long = np.column_stack([np.linspace(0.0, 1e5, 100), 40.0 * np.sin(np.arange(100.0))])
    with pytest.raises(AlignmentRefused, match="nearly straight"):
        rigid_alignment(long, long, sigma_m=2.0)


def test_a_bend_is_enough_to_be_aligned() -> None:
    bent = np.column_stack([np.linspace(0.0, 500.0, 100), np.linspace(0.0, 15.0, 100) ** 2])
    assert rigid_alignment(bent, bent, sigma_m=2.0).eigenvalue_ratio > 1e-3


def test_a_standing_vehicle_is_refused_with_its_extent_and_the_limit() -> None:
    standing = np.random.default_rng(1).normal(0.0, 0.5, (100, 2))
    with pytest.raises(AlignmentRefused, match=r"nearly stationary.*extent is 0\.\d+ m, at least 6\.00 m"):
        rigid_alignment(standing, standing, sigma_m=2.0)


def test_two_fixes_are_too_few_and_the_message_counts_them() -> None:
    with pytest.raises(AlignmentRefused, match="2 fixes match the path: at least 3"):
        rigid_alignment(bow()[:2, :2], bow()[:2, :2], sigma_m=2.0)


@settings(max_examples=30, deadline=None)
@given(HEADINGS)
def test_a_bent_alignment_needs_no_first_guess_of_the_heading(heading_rad: float) -> None:
    pose, T_map_path = bow(), np.array([400.0, -90.0, heading_rad])
    truth = placed(T_map_path, pose)
    bent = bent_alignment(pose, ARM_M, transform_points(truth, ARM_M), path_m=path_lengths(pose), sigma_m=2.0)
    # m and rad: the lever arm turns chords' directions a little where the road bends
    np.testing.assert_allclose(bent.pose[:, :2], truth[:, :2], atol=0.3)
    np.testing.assert_allclose(wrap_angles_rad(bent.pose[:, 2] - truth[:, 2]), 0.0, atol=0.05)


def test_a_start_yaw_wrong_by_112_degrees_does_not_shear_the_map() -> None:
    rng, pose = np.random.default_rng(7), bow()
    wrong = placed(np.array([0.0, 0.0, SHEAR]), pose)
    fix = transform_points(pose, ARM_M) + rng.normal(0.0, 1.0, (len(pose), 2))
    right = bent_alignment(pose, ARM_M, fix, path_m=path_lengths(pose), sigma_m=2.0)
    bent = bent_alignment(wrong, ARM_M, fix, path_m=path_lengths(pose), sigma_m=2.0)
    np.testing.assert_allclose(bent.pose, right.pose, atol=1e-6)  # m and rad: rounding, through robust rounds


def test_a_drifting_heading_is_followed() -> None:
    pose = bow()
    drifted = turned_path(pose, np.linspace(0.0, -1.0, len(pose)))  # a radian over 600 m
    fix = transform_points(pose, ARM_M)
    bent = bent_alignment(drifted, ARM_M, fix, path_m=path_lengths(pose), sigma_m=2.0)
    assert np.hypot(*(bent.pose - pose)[:, :2].T).max() < 1.0  # m: half a window of unseen drift at the ends


@settings(deadline=None)
@given(st.floats(-3.0, 3.0))
def test_turning_a_path_by_one_angle_turns_it_as_a_whole(angle_rad: float) -> None:
    pose = bow(30)
    turned = turned_path(pose, np.full(30, angle_rad))
    expected = transform_points(np.array([0.0, 0.0, angle_rad]), pose[:, :2] - pose[0, :2])
    np.testing.assert_allclose(turned[:, :2], expected, atol=1e-9)  # m, rounding


def test_a_coherent_wrong_cluster_after_an_outage_does_not_capture() -> None:
    # 100 fixes, 460 s of outage at 6 m/s, 20 fixes 700 m off that agree with one another, then right ones again.
    path_m = np.concatenate([np.arange(100) * 6.0, 600.0 + 2760.0 + np.arange(120) * 6.0])
    correction = np.random.default_rng(2).normal(0.0, 1.0, (220, 2))
    correction[100:120] += (700.0, 0.0)
    keep = consistent_fixes(correction, path_m)
    assert not keep[100:120].any()
    assert keep[:100].all()
    assert keep[120:].all()


def test_drift_over_an_outage_does_not_cost_the_fixes_after_it() -> None:
    path_m = np.concatenate([np.arange(100) * 6.0, 600.0 + 1000.0 + np.arange(100) * 6.0])
    correction = np.zeros((200, 2))
    correction[100:] = (80.0, 0.0)  # less than 20 m and a tenth of the kilometre between
    assert consistent_fixes(correction, path_m).all()


def test_a_wrong_cluster_does_not_move_the_bent_path() -> None:
    pose = bow(300)
    fix = transform_points(pose, ARM_M)
    fix[150:170] += (700.0, 0.0)
    bent = bent_alignment(pose, ARM_M, fix, path_m=path_lengths(pose), sigma_m=2.0)
    assert not bent.consistent[150:170].any()
    assert np.hypot(*(bent.pose - pose)[:, :2].T).max() < 0.5  # m: chords of the lever arm in bends


def test_fixes_that_no_path_fits_are_refused() -> None:
    pose = bow()
    fix = np.random.default_rng(4).uniform(-1e5, 1e5, (len(pose), 2))
    with pytest.raises(AlignmentRefused, match="no two fixes 12 to 60 m apart agree"):
        bent_alignment(pose, ARM_M, fix, path_m=path_lengths(pose), sigma_m=2.0)


def test_two_fixes_cannot_bend_a_path() -> None:
    pose = bow(2)
    with pytest.raises(AlignmentRefused, match="2 fixes match the path: at least 3"):
        bent_alignment(pose, ARM_M, pose[:, :2], path_m=path_lengths(pose), sigma_m=2.0)

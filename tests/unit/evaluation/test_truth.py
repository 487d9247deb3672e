import math
from dataclasses import replace

import numpy as np
import pytest

from evaluated_maps.examples import LANDMARK_SIGMA_M, SHIFT_M, solved_example
from trigpoint.events.truth import Truth
from trigpoint_evaluation.app import evaluate_truth
from trigpoint_evaluation.core.landmark_truth import MappedPoints, evaluate_landmarks, matched


def points(*position_m: tuple[float, float], signature: tuple[str, ...] = ()) -> MappedPoints:
    return MappedPoints(
        point_m=np.array(position_m, dtype=float).reshape(-1, 2),
        signature=signature or ("",) * len(position_m),
        covariance_m2=np.tile(np.eye(2), (len(position_m), 1, 1)),
    )


def test_a_map_shifted_as_a_whole_keeps_its_error() -> None:
    true = points((0.0, 0.0), (50.0, 0.0), (0.0, 50.0))
    found = evaluate_landmarks(replace(true, point_m=true.point_m + [0.6, 0.8]), true)
    assert math.isclose(found.error_m.mean, 1.0)
    assert found.error_without_shift_m.max < 1e-12  # rounding, metres


def test_two_landmarks_for_one_pole_are_one_match_and_one_duplicate() -> None:
    found = matched(points((0.1, 0.0), (0.5, 0.0), (90.0, 0.0)), points((0.0, 0.0), (40.0, 0.0)))
    assert (found.estimated.tolist(), found.truth.tolist()) == ([0], [0])
    assert (found.duplicates, found.unmatched, found.missed) == (1, 1, 1)


def test_a_known_signature_decides_even_where_another_is_nearer() -> None:
    estimated = points((0.0, 0.0), (1.0, 0.0), signature=("b", "a"))
    found = matched(estimated, points((0.0, 0.0), (1.0, 0.0), signature=("a", "b")))
    assert dict(zip(found.estimated.tolist(), found.truth.tolist(), strict=True)) == {0: 1, 1: 0}


def test_nothing_farther_than_the_limit_is_matched() -> None:
    found = matched(points((0.0, 0.0)), points((3.1, 0.0)), limit_m=3.0)
    assert (len(found.estimated), found.unmatched, found.missed) == (0, 1, 1)


def test_an_empty_map_has_no_error_and_misses_all() -> None:
    found = evaluate_landmarks(points(), points((0.0, 0.0)))
    assert (found.error_m.count, found.matches.missed) == (0, 1)


def test_joint_nees_is_that_of_the_whole_covariance() -> None:
    true = points((0.0, 0.0), (50.0, 0.0))
    estimated = replace(true, point_m=true.point_m + [1.0, 0.0])
    common = np.kron(np.ones((2, 2)), np.eye(2)) + 0.01 * np.eye(4)  # the two are wrong together by 1 m
    found = evaluate_landmarks(estimated, true, joint_covariance_m2=common)
    assert found.nees_per_dof == pytest.approx(0.5)  # 1 m at 1 m per axis: 1 over 2 degrees of freedom
    assert found.joint_nees_per_dof == pytest.approx(1.0 / 4.0, rel=0.01)  # once, not twice, over 4


def test_errors_drawn_with_the_stated_covariance_have_nees_near_1_once_the_shift_is_stated_too() -> None:
    example = solved_example()
    landmarks = tuple(
        replace(one, position_m=one.position_m - np.array(SHIFT_M)) for one in example.evaluated.solved.landmarks
    )
    evaluated = replace(example.evaluated, solved=replace(example.evaluated.solved, landmarks=landmarks))
    found = evaluate_truth(evaluated, example.truth).landmarks
    assert 0.8 < found.nees_per_dof < 1.2  # 500 landmarks: 1 +- 3 * sqrt(1 / 500)
    assert 0.92 < found.coverage_95 < 0.98  # 0.95 +- 3 * 0.01


def test_landmark_errors_are_against_truth_without_alignment() -> None:
    found = evaluate_truth(solved_example().evaluated, solved_example().truth).landmarks
    assert found.shift_m == pytest.approx(SHIFT_M, abs=0.02)  # mean of 500 errors of 0.1 m
    expected_m = math.sqrt(np.dot(SHIFT_M, SHIFT_M) + 2.0 * LANDMARK_SIGMA_M**2)
    assert found.error_m.rmse == pytest.approx(expected_m, rel=0.1)


def test_raw_fixes_are_measured_at_the_true_antenna_and_the_path_at_the_same_instants() -> None:
    found = evaluate_truth(solved_example().evaluated, solved_example().truth)
    for vehicle in found.vehicles:
        assert vehicle.raw_fix_error_m.count == vehicle.error_at_fixes_m.count
        assert 2.0 < vehicle.raw_fix_error_m.median < 10.0  # metres: the receiver's noise, some of it multipath
        assert vehicle.error_at_fixes_m.rmse == pytest.approx(0.14, abs=0.04)  # 0.1 m an axis, less between keyframes


def test_without_truth_nothing_is_measured() -> None:
    found = evaluate_truth(solved_example().evaluated, Truth())
    assert (found.landmarks.error_m.count, found.paths.error_m.count, found.gate.good_fixes) == (0, 0, 0)

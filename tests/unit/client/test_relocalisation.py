"""A pose among known landmarks: found where it is unique, never claimed where it is not."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from trigpoint.client.core.constellations import Constellation
from trigpoint.client.core.motion_fit import Expectation, PositionPrior
from trigpoint.client.core.relocalisation import Relocalised, Verdict, relocalised
from trigpoint.errors import InputError
from trigpoint.geodesy.poses import transform_points

Floats = NDArray[np.float64]

SIGHTING_SIGMA_M = 0.05
EXPECTED = Expectation(clutter_per_m2=5e-4, detected=0.7)
POSE = np.array([40.0, 25.0, 2.0])
CENTIMETRES_M = 0.1  # twice the sigma of one sighting: five of them say it better


def landmarks(point_m: Floats, *, sigma_m: float = SIGHTING_SIGMA_M, kind: str = "pole") -> Constellation:
    covariance_m2 = np.tile(sigma_m**2 * np.eye(2), (len(point_m), 1, 1))
    return Constellation(point_m=point_m, covariance_m2=covariance_m2, kind=(kind,) * len(point_m))


def seen_from(pose: Floats, point_m: Floats, *, seed: int = 3) -> Constellation:
    """Landmarks (n, 2) of the map in the frame of a base at a pose (3,), with the noise their covariance says."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    local_m = (point_m - pose[:2]) @ np.array([[c, -s], [s, c]])
    noise_m = np.random.default_rng(seed).normal(0.0, SIGHTING_SIGMA_M, local_m.shape)
    return landmarks(local_m + noise_m)


def with_clutter(observed: Constellation, point_m: Floats) -> Constellation:
    clutter = landmarks(point_m)
    return Constellation(
        point_m=np.vstack([observed.point_m, clutter.point_m]),
        covariance_m2=np.vstack([observed.covariance_m2, clutter.covariance_m2]),
        kind=observed.kind + clutter.kind,
    )


def scattered(count: int = 60, *, seed: int = 1) -> Floats:
    """Landmarks (n, 2) anywhere within 100 m by 80 m."""
    return np.random.default_rng(seed).uniform([0.0, 0.0], [100.0, 80.0], (count, 2))


def around(pose: Floats, point_m: Floats, count: int) -> Floats:
    """The `count` of landmarks (n, 2) nearest to a pose."""
    return point_m[np.argsort(np.hypot(*(point_m - pose[:2]).T))[:count]]


def prior_near(pose: Floats, *, off_m: tuple[float, float] = (12.0, -9.0)) -> PositionPrior:
    return PositionPrior(point_m=pose[:2] + np.array(off_m), sigma_m=15.0)


def found_at(pose: Floats, point_m: Floats, *, count: int = 6) -> Relocalised:
    found = relocalised(seen_from(pose, around(pose, point_m, count)), landmarks(point_m), prior_near(pose), EXPECTED)
    assert found is not None
    return found


def test_a_pose_among_scattered_landmarks_is_found_without_any_heading() -> None:
    found = found_at(POSE, scattered())
    assert found.verdict is Verdict.CONFIDENT
    assert np.hypot(*(found.T_map_base - POSE)[:2]) < CENTIMETRES_M


def test_the_pairs_name_the_landmarks_that_were_observed() -> None:
    point_m = scattered()
    found = found_at(POSE, point_m)
    observed_m = transform_points(found.T_map_base, seen_from(POSE, around(POSE, point_m, 6)).point_m)
    assert np.abs(observed_m[found.pairs[:, 0]] - point_m[found.pairs[:, 1]]).max() < 5.0 * SIGHTING_SIGMA_M


def test_things_that_are_in_no_map_do_not_mislead() -> None:
    point_m = scattered()
    observed = with_clutter(seen_from(POSE, around(POSE, point_m, 6)), np.array([[9.0, 4.0], [-7.0, 15.0]]))
    found = relocalised(observed, landmarks(point_m), prior_near(POSE), EXPECTED)
    assert found is not None
    assert found.verdict is Verdict.CONFIDENT
    assert np.hypot(*(found.T_map_base - POSE)[:2]) < CENTIMETRES_M


def test_an_evenly_spaced_row_leaves_the_place_open() -> None:
    row_m = np.column_stack([10.0 * np.arange(12.0), np.zeros(12)])
    pose = np.array([55.0, 3.0, 0.0])
    found = relocalised(seen_from(pose, row_m[3:8]), landmarks(row_m), prior_near(pose, off_m=(2.0, 1.0)), EXPECTED)
    assert found is not None
    assert found.verdict is Verdict.AMBIGUOUS


def test_the_end_of_the_row_beside_something_else_settles_it() -> None:
    row_m = np.vstack([np.column_stack([10.0 * np.arange(12.0), np.zeros(12)]), [[63.0, 11.0], [48.0, -14.0]]])
    pose = np.array([55.0, 3.0, 0.0])
    found = relocalised(seen_from(pose, row_m[[4, 5, 6, 7, 12, 13]]), landmarks(row_m), prior_near(pose), EXPECTED)
    assert found is not None
    assert found.verdict is Verdict.CONFIDENT
    assert abs(found.T_map_base[0] - pose[0]) < CENTIMETRES_M


def test_a_street_that_looks_the_same_both_ways_is_open_until_the_heading_is_roughly_known() -> None:
    side_m = np.array([[0.0, 5.0], [7.0, 5.0], [19.0, 5.0], [30.0, 5.0]])
    street_m = np.vstack([side_m, np.array([30.0, 0.0]) - side_m])
    pose = np.array([15.0, 0.0, 0.0])
    prior = prior_near(pose, off_m=(1.0, 1.0))
    headed = replace(prior, heading_rad=0.3, heading_sigma_rad=0.4)
    verdicts = [relocalised(seen_from(pose, street_m), landmarks(street_m), one, EXPECTED) for one in (prior, headed)]
    assert [found.verdict for found in verdicts if found is not None] == [Verdict.AMBIGUOUS, Verdict.CONFIDENT]


def test_what_is_seen_where_the_map_ends_is_not_found_in_it() -> None:
    elsewhere_m = POSE[:2] + np.random.default_rng(8).uniform(-25.0, 25.0, (6, 2))
    found = relocalised(seen_from(POSE, elsewhere_m), landmarks(scattered()), prior_near(POSE), EXPECTED)
    assert found is None or found.verdict is not Verdict.CONFIDENT


def test_a_prior_on_the_wrong_side_of_the_map_brings_no_answer() -> None:
    point_m = scattered()
    observed = seen_from(POSE, around(POSE, point_m, 6))
    wrong = PositionPrior(point_m=POSE[:2] + 90.0, sigma_m=15.0)
    found = relocalised(observed, landmarks(point_m), wrong, EXPECTED)
    assert found is None or found.verdict is not Verdict.CONFIDENT


def test_three_landmarks_that_fit_are_too_few_to_rely_on() -> None:
    assert found_at(POSE, scattered(), count=3).verdict is not Verdict.CONFIDENT


def test_a_landmark_of_another_kind_fits_nothing() -> None:
    point_m = scattered()
    observed = seen_from(POSE, around(POSE, point_m, 6))
    found = relocalised(observed, landmarks(point_m, kind="corner"), prior_near(POSE), EXPECTED)
    assert found is None


def test_the_order_of_the_landmarks_changes_nothing() -> None:
    point_m = scattered()
    observed, known = seen_from(POSE, around(POSE, point_m, 6)), landmarks(point_m)
    turned = Constellation(
        point_m=observed.point_m[::-1], covariance_m2=observed.covariance_m2[::-1], kind=observed.kind[::-1]
    )
    one, other = (relocalised(each, known, prior_near(POSE), EXPECTED) for each in (observed, turned))
    assert one is not None
    assert other is not None
    assert one.T_map_base == pytest.approx(other.T_map_base, abs=1e-6)  # metres, radians: rounding of sums


def test_the_error_that_all_of_the_map_shares_is_in_the_covariance() -> None:
    point_m, shared_m = scattered(), 0.3
    known = landmarks(point_m, sigma_m=shared_m)
    found = relocalised(seen_from(POSE, around(POSE, point_m, 6)), known, prior_near(POSE), EXPECTED)
    assert found is not None
    assert 0.8 * shared_m < math.sqrt(found.covariance[0, 0]) < 1.2 * shared_m  # nearly all of it is shared


def test_errors_are_as_large_as_the_covariance_says() -> None:
    point_m = scattered()
    rng = np.random.default_rng(5)
    poses = np.column_stack([rng.uniform(20.0, 80.0, 40), rng.uniform(20.0, 60.0, 40), rng.uniform(-3, 3, 40)])
    nees = [_nees(pose, point_m, seed=seed) for seed, pose in enumerate(poses)]
    assert 0.4 < float(np.nanmean(nees)) < 1.3  # below 1: errors are independent here, part is taken as shared


def _nees(pose: Floats, point_m: Floats, *, seed: int) -> float:
    observed = seen_from(pose, around(pose, point_m, 7), seed=seed)
    mapped_m = point_m + np.random.default_rng([seed, 1]).normal(0.0, SIGHTING_SIGMA_M, point_m.shape)
    found = relocalised(observed, landmarks(mapped_m), prior_near(pose), EXPECTED)
    if found is None or found.verdict is not Verdict.CONFIDENT:
        return math.nan
    off = found.T_map_base - pose
    off[2] = (off[2] + math.pi) % (2.0 * math.pi) - math.pi
    return float(off @ np.linalg.solve(found.covariance, off)) / 3.0


def test_a_covariance_that_is_none_is_refused_with_its_eigenvalue() -> None:
    with pytest.raises(InputError, match=r"eigenvalue of -1 m\^2"):
        Constellation(point_m=np.zeros((1, 2)), covariance_m2=-np.eye(2)[None], kind=("pole",))


def test_a_position_that_is_not_finite_is_refused() -> None:
    with pytest.raises(InputError, match="not finite"):
        landmarks(np.array([[np.nan, 0.0]]))

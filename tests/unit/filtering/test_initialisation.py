"""Position and heading come from fixes that agree with the way driven, or are refused with the reason."""

import math

import numpy as np
import pytest

from trigpoint.errors import AlignmentRefused
from trigpoint.geodesy.poses import Pose2, wrap_angle_rad
from trigpoint_filtering.core.estimator import GnssNoise
from trigpoint_filtering.core.initialisation import Seeker, after_pair, aligned, placed, prior_calibration
from trigpoint_filtering.core.motion import BIAS_X, Geometry, TurnSource, X

T_MAP_LOCAL = Pose2(120.0, -40.0, 2.2)
ANTENNA = Pose2(1.5, 0.4, 0.0)


def seeker_along(way_m: np.ndarray, *, shift_m: dict[int, float] | None = None) -> Seeker:
    """A seeker driven along its local x axis, with exact fixes but for the shifted ones."""
    seeker = Seeker(Pose2(0.0, 0.0, 0.0))
    for number, x_m in enumerate(way_m):
        seeker = Seeker(Pose2(float(x_m), 0.0, 0.0), seeker.pairs)
        antenna = T_MAP_LOCAL.compose(seeker.T_local_base).compose(ANTENNA)
        fix_m = np.array([antenna.x_m + (shift_m or {}).get(number, 0.0), antenna.y_m])
        seeker = after_pair(seeker, fix_m, antenna=ANTENNA)
    return seeker


def test_a_straight_stretch_gives_position_and_heading() -> None:
    found = aligned(seeker_along(np.arange(0.0, 40.0, 4.0)), sigma_m=0.5).T_map_local
    assert (found.x_m, found.y_m) == pytest.approx((120.0, -40.0), abs=1e-6)
    assert wrap_angle_rad(found.heading_rad - 2.2) == pytest.approx(0.0, abs=1e-9)


def test_dead_reckoning_begun_112_degrees_off_is_turned_back() -> None:
    turned = Pose2(0.0, 0.0, math.radians(112.0))
    seeker = Seeker(turned)
    for x_m in np.arange(0.0, 40.0, 4.0):
        seeker = Seeker(turned.compose(Pose2(float(x_m), 0.0, 0.0)), seeker.pairs)
        antenna = T_MAP_LOCAL.compose(Pose2(float(x_m), 0.0, 0.0)).compose(ANTENNA)
        seeker = after_pair(seeker, np.array([antenna.x_m, antenna.y_m]), antenna=ANTENNA)
    T_map_base = aligned(seeker, sigma_m=0.5).T_map_local.compose(seeker.T_local_base)
    assert wrap_angle_rad(T_map_base.heading_rad - 2.2) == pytest.approx(0.0, abs=1e-9)


def test_a_nearly_stationary_stretch_is_refused_with_its_heading_sigma() -> None:
    with pytest.raises(AlignmentRefused, match=r"heading known to .* rad only: 0.3 rad is the limit"):
        aligned(seeker_along(np.arange(0.0, 8.0, 1.1)), sigma_m=3.0)


def test_too_few_fixes_are_refused_with_their_number() -> None:
    with pytest.raises(AlignmentRefused, match="3 fixes along the way: 6 are needed"):
        aligned(seeker_along(np.array([0.0, 10.0, 20.0])), sigma_m=1.0)


def test_standing_still_collects_nothing() -> None:
    assert len(seeker_along(np.zeros(50)).pairs) <= 2


def test_memory_is_bounded_however_long_the_search() -> None:
    assert len(seeker_along(np.arange(0.0, 2000.0, 4.0)).pairs) == 64


def test_one_wrong_fix_among_the_first_is_left_out() -> None:
    found = aligned(seeker_along(np.arange(0.0, 40.0, 4.0), shift_m={5: 80.0}), sigma_m=0.5)
    assert found.T_map_local.x_m == pytest.approx(120.0, abs=1e-6)


def test_a_newest_fix_that_does_not_fit_initialises_nothing() -> None:
    with pytest.raises(AlignmentRefused, match="newest fix"):
        aligned(seeker_along(np.arange(0.0, 40.0, 4.0), shift_m={9: 80.0}), sigma_m=0.5)


def test_fixes_that_follow_another_way_are_refused() -> None:
    shifts = {number: 60.0 * (-1) ** number for number in range(20)}
    with pytest.raises(AlignmentRefused, match="disagree with the way driven"):
        aligned(seeker_along(np.arange(0.0, 80.0, 4.0), shift_m=shifts), sigma_m=0.5)


def test_a_position_starts_as_uncertain_as_the_bias_it_may_carry() -> None:
    alignment = aligned(seeker_along(np.arange(0.0, 40.0, 4.0)), sigma_m=0.5)
    prior = prior_calibration(TurnSource.IMU, Geometry(2.5, 0.0, 1.5, 0.4, 1.0), antenna_sigma_m=0.1)
    belief = placed(prior, T_MAP_LOCAL, alignment, GnssNoise(1.0, 2.5, 120.0))
    assert math.sqrt(belief.covariance[X, X]) > 2.5
    # What has been seen is the sum of both: that is known to the white noise and the lever arm.
    seen_m2 = belief.covariance[X, X] + 2.0 * belief.covariance[X, BIAS_X] + belief.covariance[BIAS_X, BIAS_X]
    assert math.sqrt(seen_m2) == pytest.approx(1.0, abs=0.05)

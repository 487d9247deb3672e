"""Position and heading found by laying a dead-reckoned stretch onto the fixes received along it."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import AlignmentRefused
from trigpoint.geodesy.poses import Pose2
from trigpoint_filtering.core.estimator import Belief, GnssNoise, sound_covariance
from trigpoint_filtering.core.motion import (
    ANTENNA_X,
    ANTENNA_Y,
    BIAS_X,
    BIAS_Y,
    HEADING,
    SPEED_SCALE,
    SPEED_SCALE_SIGMA,
    STATE_SIZE,
    TURN_BIAS,
    TURN_NOISE,
    TURN_SCALE,
    Geometry,
    TurnSource,
    X,
    Y,
)

Floats = NDArray[np.float64]

MAX_PAIRS = 64  # bounds memory and work
PAIR_SPACING_M = 1.0  # of antenna way between pairs: fixes at standstill say nothing new
MIN_PAIRS = 6
WINDOWS = (6, 8, 12, 16, 24, 32, 48, 64)  # newest pairs tried, fewest first: dead reckoning drifts
MAX_OUTLIER_SHARE = 0.3
INLIER_SIGMAS = 3.0
MAX_HEADING_SIGMA_RAD = 0.3  # the unscented filter converges from beyond this
CORRELATION_INFLATION = 2.0  # of the heading's sigma: consecutive fixes share their error
HEADING_SIGMA_FLOOR_RAD = 0.02
NEWEST_DRIFT_SHARE = 0.6  # of a stretch's drift is what its end differs from its mean: 1/sqrt(3)


@dataclass(frozen=True, slots=True)
class Pair:
    """A fix in the map frame, and the antenna where dead reckoning put it, metres.

    `drift_rad2`: variance of the dead-reckoned heading by then.
    """

    fix_x_m: float
    fix_y_m: float
    antenna_x_m: float
    antenna_y_m: float
    drift_rad2: float


@dataclass(frozen=True, slots=True)
class Seeker:
    """A search for the map: `T_local_base` by dead reckoning in a local frame of its own, and newest pairs."""

    T_local_base: Pose2
    pairs: tuple[Pair, ...] = ()
    drift_rad2: float = 0.0


@dataclass(frozen=True, slots=True)
class Alignment:
    """`T_map_local` with the sigma of its heading, the sigma of fixes about it, and how many it rests on."""

    T_map_local: Pose2
    heading_sigma_rad: float
    scatter_m: float
    count: int


def after_pair(seeker: Seeker, fix_m: Floats, *, antenna: Pose2) -> Seeker:
    """The seeker with one more fix (2,); the newest pair is replaced until the antenna has moved on."""
    at = seeker.T_local_base.compose(antenna)
    pair = Pair(float(fix_m[0]), float(fix_m[1]), at.x_m, at.y_m, seeker.drift_rad2)
    kept = seeker.pairs
    if len(kept) > 1 and _way_m(kept[-2], pair) < PAIR_SPACING_M:
        kept = kept[:-1]
    return replace(seeker, pairs=(*kept, pair)[-MAX_PAIRS:])


def _way_m(first: Pair, second: Pair) -> float:
    return math.hypot(second.antenna_x_m - first.antenna_x_m, second.antenna_y_m - first.antenna_y_m)


def aligned(seeker: Seeker, *, sigma_m: float) -> Alignment:
    """The alignment of a seeker's newest pairs, as few as fix the heading; `sigma_m` of one fix, white.

    Raises AlignmentRefused while pairs are few, the way is too short for a heading, or fixes disagree.
    """
    if len(seeker.pairs) < MIN_PAIRS:
        raise AlignmentRefused(f"{len(seeker.pairs)} fixes along the way: {MIN_PAIRS} are needed")
    for count in WINDOWS:
        try:
            return _aligned_pairs(seeker.pairs[-count:], sigma_m)
        except AlignmentRefused:
            if count >= len(seeker.pairs):
                raise
    raise AssertionError("the last window holds every pair")


def _aligned_pairs(pairs: tuple[Pair, ...], sigma_m: float) -> Alignment:
    """The alignment of pairs; fixes that lie too far off are left out one by one."""
    rows = np.array([(p.fix_x_m, p.fix_y_m, p.antenna_x_m, p.antenna_y_m) for p in pairs])
    drift_rad = math.sqrt(pairs[-1].drift_rad2 - pairs[0].drift_rad2)
    newest, kept = rows[-1], rows
    way_m = float(np.sum(np.hypot(*np.diff(rows[:, 2:], axis=0).T)))
    allowed_m = INLIER_SIGMAS * math.hypot(sigma_m, 0.25 * drift_rad * way_m)
    for _ in range(int(MAX_OUTLIER_SHARE * len(rows)) + 1):
        alignment, residual_m = _least_squares(kept, sigma_m, drift_rad)
        worst = int(np.argmax(residual_m))
        if residual_m[worst] <= allowed_m:
            return _usable(alignment, kept, newest)
        kept = np.delete(kept, worst, axis=0)
    raise AlignmentRefused(
        f"fixes disagree with the way driven by {residual_m[worst]:.1f} m: {allowed_m:.1f} m is the limit"
    )


def _usable(alignment: Alignment, kept: Floats, newest: Floats) -> Alignment:
    if alignment.heading_sigma_rad > MAX_HEADING_SIGMA_RAD:
        raise AlignmentRefused(
            f"heading known to {alignment.heading_sigma_rad:.2f} rad only: {MAX_HEADING_SIGMA_RAD} rad is the limit"
        )
    if not np.array_equal(kept[-1], newest) or len(kept) < MIN_PAIRS - 1:
        raise AlignmentRefused(f"the newest fix does not fit the {len(kept)} that agree")
    return alignment


def _least_squares(rows: Floats, sigma_m: float, drift_rad: float) -> tuple[Alignment, Floats]:
    """The rigid motion of the plane from antenna to fix (Umeyama 1991, without scale), and residuals (n,) in m."""
    fix_mean, antenna_mean = rows[:, :2].mean(axis=0), rows[:, 2:].mean(axis=0)
    fix, antenna = rows[:, :2] - fix_mean, rows[:, 2:] - antenna_mean
    dot, cross = np.sum(antenna * fix), np.sum(antenna[:, 0] * fix[:, 1] - antenna[:, 1] * fix[:, 0])
    heading_rad = math.atan2(cross, dot)
    turned = Pose2(0.0, 0.0, heading_rad).transform(*antenna_mean)
    T_map_local = Pose2(float(fix_mean[0] - turned[0]), float(fix_mean[1] - turned[1]), heading_rad)
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    residual = fix - antenna @ np.array([[c, s], [-s, c]])
    spread_m = math.sqrt(float(np.sum(antenna**2)))
    sigma_rad = CORRELATION_INFLATION * sigma_m / spread_m if spread_m > 0.0 else math.inf
    length = np.hypot(residual[:, 0], residual[:, 1])
    scatter_m = math.sqrt(float(np.mean(length**2)) / 2.0)
    heading_sigma_rad = math.hypot(sigma_rad, HEADING_SIGMA_FLOOR_RAD, drift_rad * NEWEST_DRIFT_SHARE)
    return Alignment(T_map_local, heading_sigma_rad, scatter_m, len(rows)), length


def prior_calibration(source: TurnSource, geometry: Geometry, *, antenna_sigma_m: float) -> Belief:
    """What is believed of a vehicle before it moves: nothing of its pose, the nominal of everything else."""
    mean, sigma = np.zeros(STATE_SIZE), np.ones(STATE_SIZE)
    noise = TURN_NOISE[source]
    mean[[SPEED_SCALE, TURN_SCALE]] = 1.0
    mean[[ANTENNA_X, ANTENNA_Y]] = geometry.antenna_x_m, geometry.antenna_y_m
    sigma[SPEED_SCALE : TURN_BIAS + 1] = SPEED_SCALE_SIGMA, noise.scale_sigma, noise.bias_sigma
    sigma[[ANTENNA_X, ANTENNA_Y]] = antenna_sigma_m
    return Belief(mean, np.diag(sigma**2))


def placed(calibration: Belief, T_map_base: Pose2, alignment: Alignment, noise: GnssNoise) -> Belief:
    """A belief at a pose found by alignment, with the calibration's own mean and covariance.

    Position and GNSS bias start fully correlated: only their sum has been seen.
    """
    mean, covariance = calibration.mean.copy(), np.zeros((STATE_SIZE, STATE_SIZE))
    mean[[X, Y, HEADING]] = T_map_base.x_m, T_map_base.y_m, T_map_base.heading_rad
    mean[[BIAS_X, BIAS_Y]] = 0.0
    kept = slice(SPEED_SCALE, ANTENNA_Y + 1)
    covariance[kept, kept] = calibration.covariance[kept, kept]
    lever_m2 = calibration.covariance[ANTENNA_X, ANTENNA_X] + calibration.covariance[ANTENNA_Y, ANTENNA_Y]
    white_m2 = max(noise.white_sigma_m, alignment.scatter_m) ** 2
    covariance[X, X] = covariance[Y, Y] = noise.bias_sigma_m**2 + white_m2 + lever_m2
    covariance[BIAS_X, BIAS_X] = covariance[BIAS_Y, BIAS_Y] = noise.bias_sigma_m**2
    covariance[X, BIAS_X] = covariance[BIAS_X, X] = covariance[Y, BIAS_Y] = covariance[BIAS_Y, Y] = -(
        noise.bias_sigma_m**2
    )
    covariance[HEADING, HEADING] = alignment.heading_sigma_rad**2
    return Belief(mean, sound_covariance(covariance))

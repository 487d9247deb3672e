"""Beliefs carried forward and corrected by an unscented Kalman filter; filterpy's home."""

import math
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter, unscented_transform
from numpy.typing import NDArray

from trigpoint.geodesy.uncertainty import floored_covariance
from trigpoint_filtering.core.motion import (
    ANTENNA_X,
    ANTENNA_Y,
    BIAS_X,
    BIAS_Y,
    HEADING,
    SPEED_SCALE,
    STATE_SIZE,
    TURN_BIAS,
    Geometry,
    MotionStep,
    TurnSource,
    X,
    Y,
    moved,
    step_variance,
)

Floats = NDArray[np.float64]

CORRELATION_FLOOR = 1e-9  # least eigenvalue of the correlation matrix: safely above double rounding
VARIANCE_FLOOR = 1e-14
POSE_COVARIANCE_FLOOR = 1e-9  # m^2 and rad^2: 0.03 mm and 0.03 mrad
VARIANCE_CAP = np.array([1e10, 1e10, 1.0, 0.25, 0.25, 0.25, 25.0, 25.0, 1e4, 1e4])  # past these nothing is known


REST_RADPS2S = 1e-6  # (rad/s)^2 s: 1 mrad/s after a second at rest, some three times a MEMS gyroscope's noise


@dataclass(frozen=True, slots=True)
class Belief:
    """Mean (10,) and covariance (10, 10) of the motion state."""

    mean: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True)
class Correction:
    """What a fix would do: the belief after it, innovation (2,) in m and its covariance (2, 2), and NIS."""

    belief: Belief
    innovation_m: Floats
    innovation_covariance: Floats
    nis: float


@dataclass(frozen=True, slots=True)
class GnssNoise:
    """Error of one fix, per axis: white sigma, and the sigma and correlation time of the wandering bias."""

    white_sigma_m: float
    bias_sigma_m: float
    bias_time_s: float


class _SigmaPoints(MerweScaledSigmaPoints):  # type: ignore[misc]
    """Merwe's points, all at once."""

    def sigma_points(self, x: Floats, P: Floats) -> Floats:
        spread = np.linalg.cholesky((self.alpha**2 * (self.n + self.kappa)) * P).T
        return np.concatenate([x[None, :], x + spread, x - spread])


class _Filter(UnscentedKalmanFilter):  # type: ignore[misc]
    """filterpy's filter with the loops over sigma points done by array."""

    x: Floats
    P: Floats

    def compute_process_sigmas(self, dt: float, fx: object = None, **fx_args: object) -> None:
        self.sigmas_f = self.fx(self.points_fn.sigma_points(self.x, self.P), dt, **fx_args)

    def predict(self, dt: float, **fx_args: object) -> None:
        """filterpy's, without drawing sigma points anew: a correction draws its own."""
        self.compute_process_sigmas(dt, **fx_args)
        self.x, self.P = unscented_transform(self.sigmas_f, self.Wm, self.Wc, self.Q)

    def cross_variance(self, x: Floats, z: Floats, sigmas_f: Floats, sigmas_h: Floats) -> Floats:
        crossed: Floats = (self.Wc[:, None] * (sigmas_f - x)).T @ (sigmas_h - z)
        return crossed


def _antenna_seen(state: Floats) -> Floats:
    """Where a fix is expected, (2,) in m: the antenna, moved by the GNSS bias."""
    c, s = math.cos(state[HEADING]), math.sin(state[HEADING])
    x_m = state[X] + c * state[ANTENNA_X] - s * state[ANTENNA_Y] + state[BIAS_X]
    y_m = state[Y] + s * state[ANTENNA_X] + c * state[ANTENNA_Y] + state[BIAS_Y]
    return np.array([x_m, y_m])


class Estimator:
    """Predicts and corrects beliefs about one vehicle; keeps nothing between calls."""

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        # alpha 1, kappa 0: no weight is negative, so that no covariance can turn indefinite (Wan, Merwe 2000).
        points = _SigmaPoints(STATE_SIZE, alpha=1.0, beta=2.0, kappa=0.0)
        self._filter = _Filter(STATE_SIZE, 2, 1.0, hx=_antenna_seen, fx=self._moved, points=points)

    def _moved(self, state: Floats, dt_s: float, *, step: MotionStep, bias_time_s: float) -> Floats:
        return moved(state, step, self.geometry, bias_time_s=bias_time_s)

    def predicted(self, belief: Belief, step: MotionStep, noise: GnssNoise) -> Belief:
        """The belief after a step."""
        variance = step_variance(
            step, self.geometry, gnss_bias_sigma_m=noise.bias_sigma_m, bias_time_s=noise.bias_time_s
        )
        self._filter.x, self._filter.P, self._filter.Q = belief.mean, belief.covariance, np.diag(variance)
        self._filter.predict(dt=step.dt_s, step=step, bias_time_s=noise.bias_time_s)
        return Belief(self._filter.x, _kept_sound(self._filter.P))

    def corrected(self, belief: Belief, fix_m: Floats, noise: GnssNoise) -> Correction:
        """What a fix (2,) in the map frame would do to a belief."""
        unscented = self._filter
        unscented.x, unscented.P = belief.mean, belief.covariance
        unscented.sigmas_f = unscented.points_fn.sigma_points(belief.mean, belief.covariance)
        unscented.update(fix_m, R=noise.white_sigma_m**2 * np.eye(2))
        nis = float(unscented.y @ np.linalg.solve(unscented.S, unscented.y))
        after = Belief(unscented.x, sound_covariance(unscented.P))
        return Correction(after, unscented.y, unscented.S, nis)


def rested(belief: Belief, step: MotionStep) -> Belief:
    """The belief after a step at rest: a gyroscope that turns while nothing moves shows its bias."""
    if step.source is not TurnSource.IMU:
        return belief
    gain = belief.covariance[:, TURN_BIAS] / (belief.covariance[TURN_BIAS, TURN_BIAS] + REST_RADPS2S / step.dt_s)
    mean = belief.mean - gain * (step.turn + belief.mean[TURN_BIAS])
    return Belief(mean, sound_covariance(belief.covariance - np.outer(gain, belief.covariance[TURN_BIAS])))


def _kept_sound(covariance: Floats) -> Floats:
    """A predicted covariance, symmetric; rebuilt only if a variance has left its bounds."""
    variance = covariance.diagonal()
    if (variance < VARIANCE_CAP).all() and variance.min() > VARIANCE_FLOOR:
        return 0.5 * (covariance + covariance.T)
    return sound_covariance(covariance)


def sound_covariance(covariance: Floats) -> Floats:
    """The covariance (10, 10) made symmetric positive definite, variances within their bounds.

    Scaled to correlations first, so that kilometres and milliradians are floored alike.
    """
    variance = np.maximum(covariance.diagonal(), VARIANCE_FLOOR)
    scale = 1.0 / np.sqrt(variance)
    correlation = floored_covariance(covariance * np.outer(scale, scale), floor=CORRELATION_FLOOR)
    sigma = np.sqrt(np.minimum(variance, VARIANCE_CAP))
    return correlation * np.outer(sigma, sigma)


def pose_covariance(covariance: Floats) -> Floats:
    """The part (3, 3), x, y in m and heading in rad, of a covariance (10, 10), positive definite by a margin."""
    part = covariance[:SPEED_SCALE, :SPEED_SCALE]
    return floored_covariance(part, floor=POSE_COVARIANCE_FLOOR)


def pose_covariances(covariance: Floats) -> Floats:
    """`pose_covariance` of many at once: (n, 3, 3) from (n, 3, 3); what is sound stays as it is."""
    symmetric: Floats = 0.5 * (covariance + covariance.transpose(0, 2, 1))
    for index in np.flatnonzero(np.linalg.eigvalsh(symmetric)[:, 0] < POSE_COVARIANCE_FLOOR):
        symmetric[index] = floored_covariance(symmetric[index], floor=POSE_COVARIANCE_FLOOR)
    return symmetric

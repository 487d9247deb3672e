"""Wheels that were sampled, not counted: a momentary speed of each wheel once a second or so.

What happens between the samples is lost, and motion faster than half the sampling rate, such as the sway of a
balancing vehicle, shows as slow turns that never were (aliasing).
"""

import numpy as np
from numpy.typing import NDArray

from trigpoint_optimisation.core.robust_scale import robust_sigma

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

COARSE_S = 0.5  # s: a walking pace vehicle begins and ends a turn within one or two seconds
MOVING_MPS = 0.3  # m/s: slower, a vehicle is as good as standing and its wheels say nothing of its wobble
SECOND_DIFFERENCE = np.sqrt(6.0)  # sigma of w[i-1] - 2 w[i] + w[i+1] by sigma of white w
SMOOTHING = (0.25, 0.5, 0.25)  # weights of neighbouring samples: nothing is left of what alternates
MIN_SAMPLES = 20  # fewer second differences have no median worth the name

SPEED_MPS = 0.01  # m/s: resolution of the speeds
SPEED_SHARE = 0.10  # of the speed: it changes by a tenth within a second of driving
TURN_RADPS = 0.02  # rad/s: resolution of the speeds by the track
TURN_RAD_PER_M = 0.06  # rad/s by m/s: unseen turns at walking pace, what second differences leave after smoothing
TURN_SHARE = 0.25  # of the turn: where between two samples it begins and ends is unknown to a quarter of a sample


def coarsely_sampled(stamp_ns: Ints) -> bool:
    """Whether wheel samples (n,) are so far apart that a turn may begin and end between two."""
    return len(stamp_ns) > 1 and float(np.median(np.diff(stamp_ns))) * 1e-9 >= COARSE_S


def wobble_radps(yaw_rate_radps: Floats, speed_mps: Floats) -> float:
    """1-sigma in rad/s of what does not last from one sample (n,) to the next, while moving."""
    change = yaw_rate_radps[2:] - 2.0 * yaw_rate_radps[1:-1] + yaw_rate_radps[:-2]
    change = change[speed_mps[1:-1] > MOVING_MPS]
    if len(change) < MIN_SAMPLES:
        return 0.0
    return robust_sigma(change) / float(SECOND_DIFFERENCE)


def without_wobble(yaw_rate_radps: Floats, sigma_radps: float) -> Floats:
    """Yaw rates (n,) where turns that last stay and wobble of `sigma_radps` on straights is taken out.

    The empirical Wiener gain m^2 / (m^2 + sigma^2), with m the rate smoothed over its neighbours.
    """
    if sigma_radps <= 0.0 or len(yaw_rate_radps) < len(SMOOTHING):
        return yaw_rate_radps
    lasting = np.convolve(yaw_rate_radps, SMOOTHING, mode="same") ** 2
    return yaw_rate_radps * lasting / (lasting + sigma_radps**2)


def _accumulated(*sigmas: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(sum(sigma**2 for sigma in sigmas))])


def sampled_speed_variance(step_m: Floats, dt_s: Floats) -> Floats:
    """Variance (n,) in m2 of the way since the start, from steps (n-1,) of dt_s (n-1,)."""
    return _accumulated(SPEED_MPS * dt_s, SPEED_SHARE * step_m)


def sampled_turn_variance(step_m: Floats, turn_rad: Floats, dt_s: Floats) -> Floats:
    """Variance (n,) in rad2 of the heading since the start, from steps and turns (n-1,) of dt_s (n-1,)."""
    return _accumulated(TURN_RADPS * dt_s, TURN_RAD_PER_M * step_m, TURN_SHARE * turn_rad)

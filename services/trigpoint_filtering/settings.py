"""What can be set about filtering, with the values that were tuned on recorded drives."""

from dataclasses import dataclass

from trigpoint.configuration.limits import Positive, Probability, Share


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterSettings:
    """Noise of the sensors and limits of the gate; sigmas are 1-sigma per axis.

    A fix's error is taken as white noise plus a bias that wanders (first-order Gauss-Markov): consecutive
    fixes of real receivers are correlated, 0.94 at 1 s and 0.51 at 10 s on Victoria Park.
    """

    gnss_sigma_m: Positive = 2.0  # total, where the receiver declares none
    gnss_sigma_floor_m: Positive = 1.0  # receivers claim less than they hold (declared 3 m on NCLT, p99 235 m)
    gnss_sigma_cap_m: Positive = 10.0
    gnss_white_share: Share = 0.55  # of the total sigma; the rest, in quadrature, is the bias
    gnss_bias_time_s: Positive = 120.0
    gate_probability: Probability = 0.95
    antenna_sigma_m: float = 0.3
    max_step_s: Positive = 0.2  # inputs are averaged over this: predicting at 10 Hz is no better and costs twice
    pose_interval_s: Positive = 0.2  # between published poses

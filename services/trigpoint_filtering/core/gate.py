"""Which fixes a hypothesis takes: the chi-square gate, outages, and runs of fixes that end them."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint_filtering.core.estimator import Belief, Correction, Estimator, GnssNoise, sound_covariance
from trigpoint_filtering.core.motion import BIAS_X, BIAS_Y, HEADING, X, Y

Floats = NDArray[np.float64]

SECONDS_PER_NS = 1e-9
OUTAGE_S = 10.0  # without an accepted fix; slower receivers: four of their intervals
OUTAGE_INTERVALS = 4.0
KEPT_INTERVALS = 5
RUN_FIXES = 4  # that agree among themselves end an outage
RUN_SPAN_S = 1.5
WIDE_GATE_M = 100.0  # radius from which on a gate lets wrong clusters through:
WIDE_RUN_SPAN_S = 25.0  # a run must then outlast them (20 s were seen)
LOST_HEADING_RAD = 0.8  # sigma from which on a heading says nothing, and neither does a gate
KEPT_RUN_FIXES = 64
RUN_SIGMAS = 3.0  # within which a fix agrees with its run
RELOCATION_SPAN_S = 40.0  # of a run outside the gate before it is believed: reflections last less
DRIFT_M = 3.0  # by which a run may miss the gate and still be believed: this,
DRIFT_SHARE = 0.02  # this share of the way since the last accepted fix,
DRIFT_SIGMAS = 3.0  # and this many sigmas of the prediction

INSIDE, OUTSIDE, OUTAGE, REACQUIRED, INITIALISED = (
    "inside gate",
    "outside gate",
    "outage",
    "re-acquired",
    "initialised",
)


@dataclass(frozen=True, slots=True)
class Fix:
    """A fix in the map frame, (2,) in m, with its noise."""

    stamp_ns: int
    point_m: Floats
    noise: GnssNoise


@dataclass(frozen=True, slots=True)
class RunFix:
    """How far a fix lay from the prediction: the innovation, in m east and north, and the way driven so far."""

    stamp_ns: int
    offset_x_m: float
    offset_y_m: float
    odometer_m: float


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """One belief of where the vehicle is, and its standing with the fixes.

    `odometer_m` counts the way driven; `run` holds the newest fixes it did not take that agree with one another.
    """

    belief: Belief
    born_ns: int
    accepted_ns: int
    accepted_count: int = 0
    rejected_count: int = 0
    odometer_m: float = 0.0
    accepted_odometer_m: float = 0.0
    run: tuple[RunFix, ...] = ()
    interval_s: tuple[float, ...] = ()
    heard_ns: int = 0


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a hypothesis says of a fix."""

    accepted: bool
    reason: str
    nis: float
    innovation_m: Floats
    gate_radius_m: float


def judged(hypothesis: Hypothesis, fix: Fix, estimator: Estimator, *, limit: float) -> tuple[Hypothesis, Verdict]:
    """The hypothesis after a fix, and its verdict. A rejected fix leaves the belief as it was."""
    heard = _heard(hypothesis, fix.stamp_ns)
    correction = estimator.corrected(hypothesis.belief, fix.point_m, fix.noise)
    inside = correction.nis <= limit
    outage = in_outage(heard, fix.stamp_ns)
    if inside and not outage:
        return _accepted(heard, correction.belief, fix), _verdict(correction, limit, INSIDE)
    running = replace(heard, run=_extended_run(heard, correction, fix))
    if outage and not has_lost_heading(hypothesis):
        if inside and _is_complete(running.run, _gate_radius_m(correction, limit)):
            return _accepted(running, correction.belief, fix), _verdict(correction, limit, REACQUIRED)
        if _span_s(running.run) >= RELOCATION_SPAN_S and _is_within_drift(running, correction):
            return _accepted(running, _relocated(running, fix), fix), _verdict(correction, limit, REACQUIRED)
    rejected = replace(running, rejected_count=running.rejected_count + 1)
    return rejected, _verdict(correction, limit, OUTAGE if outage else OUTSIDE)


def in_outage(hypothesis: Hypothesis, stamp_ns: int) -> bool:
    """Whether too long has passed since the last accepted fix for a single one to be trusted."""
    usual_s = float(np.median(hypothesis.interval_s)) if hypothesis.interval_s else 0.0
    elapsed_s = (stamp_ns - hypothesis.accepted_ns) * SECONDS_PER_NS
    return elapsed_s > max(OUTAGE_S, OUTAGE_INTERVALS * usual_s)


def _heard(hypothesis: Hypothesis, stamp_ns: int) -> Hypothesis:
    if hypothesis.heard_ns == 0:
        return replace(hypothesis, heard_ns=stamp_ns)
    interval_s = max((stamp_ns - hypothesis.heard_ns) * SECONDS_PER_NS, 0.0)
    return replace(hypothesis, heard_ns=stamp_ns, interval_s=(*hypothesis.interval_s, interval_s)[-KEPT_INTERVALS:])


def _verdict(correction: Correction, limit: float, reason: str) -> Verdict:
    accepted = reason in (INSIDE, REACQUIRED)
    return Verdict(accepted, reason, correction.nis, correction.innovation_m, _gate_radius_m(correction, limit))


def _gate_radius_m(correction: Correction, limit: float) -> float:
    return math.sqrt(limit) * _widest_sigma_m(correction)


def _widest_sigma_m(correction: Correction) -> float:
    return math.sqrt(float(np.linalg.eigvalsh(correction.innovation_covariance)[-1]))


def _accepted(hypothesis: Hypothesis, belief: Belief, fix: Fix) -> Hypothesis:
    return replace(
        hypothesis,
        belief=belief,
        accepted_ns=fix.stamp_ns,
        accepted_count=hypothesis.accepted_count + 1,
        rejected_count=0,
        accepted_odometer_m=hypothesis.odometer_m,
        run=(),
    )


def _extended_run(hypothesis: Hypothesis, correction: Correction, fix: Fix) -> tuple[RunFix, ...]:
    """The run with a fix added, or a new one begun by it if it disagrees with the run's mean."""
    x_m, y_m = float(correction.innovation_m[0]), float(correction.innovation_m[1])
    newest = RunFix(fix.stamp_ns, x_m, y_m, hypothesis.odometer_m)
    run = hypothesis.run
    if not run:
        return (newest,)
    mean_m = _mean_offset(run)
    heading_sigma_rad = math.sqrt(float(hypothesis.belief.covariance[HEADING, HEADING]))
    way_m = hypothesis.odometer_m - run[0].odometer_m
    allowed_m = RUN_SIGMAS * (fix.noise.white_sigma_m * math.sqrt(1.0 + 1.0 / len(run)) + heading_sigma_rad * way_m)
    agrees = math.hypot(x_m - mean_m[0], y_m - mean_m[1]) <= allowed_m
    if not agrees:
        return (newest,)
    return (*run, newest) if len(run) < KEPT_RUN_FIXES else (run[0], *run[2:], newest)


def _mean_offset(run: tuple[RunFix, ...]) -> tuple[float, float]:
    return sum(fix.offset_x_m for fix in run) / len(run), sum(fix.offset_y_m for fix in run) / len(run)


def has_lost_heading(hypothesis: Hypothesis) -> bool:
    """Whether the heading is so uncertain that only a new alignment can bring it back."""
    return bool(hypothesis.belief.covariance[HEADING, HEADING] > LOST_HEADING_RAD**2)


def _is_complete(run: tuple[RunFix, ...], gate_radius_m: float) -> bool:
    needed_s = RUN_SPAN_S if gate_radius_m < WIDE_GATE_M else WIDE_RUN_SPAN_S
    return len(run) >= RUN_FIXES and _span_s(run) >= needed_s


def _span_s(run: tuple[RunFix, ...]) -> float:
    return (run[-1].stamp_ns - run[0].stamp_ns) * SECONDS_PER_NS


def _is_within_drift(hypothesis: Hypothesis, correction: Correction) -> bool:
    return math.hypot(*_mean_offset(hypothesis.run)) <= drift_bound_m(hypothesis, _widest_sigma_m(correction))


def drift_bound_m(hypothesis: Hypothesis, sigma_m: float) -> float:
    """How far a hypothesis may have strayed since its last accepted fix; `sigma_m` of its prediction."""
    way_m = hypothesis.odometer_m - hypothesis.accepted_odometer_m
    return DRIFT_M + DRIFT_SHARE * way_m + DRIFT_SIGMAS * sigma_m


def _relocated(hypothesis: Hypothesis, fix: Fix) -> Belief:
    """The belief moved by its run's mean offset; the position's sigma is the offset's own size."""
    offset_m = _mean_offset(hypothesis.run)
    mean, covariance = hypothesis.belief.mean.copy(), hypothesis.belief.covariance.copy()
    mean[X] += offset_m[0]
    mean[Y] += offset_m[1]
    anew = [X, Y, BIAS_X, BIAS_Y]
    covariance[anew, :] = 0.0
    covariance[:, anew] = 0.0
    bias_m2 = fix.noise.bias_sigma_m**2
    mean[[BIAS_X, BIAS_Y]] = 0.0
    for position, bias in ((X, BIAS_X), (Y, BIAS_Y)):
        covariance[position, position] = bias_m2 + fix.noise.white_sigma_m**2
        covariance[bias, bias] = bias_m2
        covariance[position, bias] = covariance[bias, position] = -bias_m2
    way_m = max(hypothesis.odometer_m - hypothesis.accepted_odometer_m, 1.0)
    covariance[HEADING, HEADING] += min(math.hypot(*offset_m) / way_m, 0.3) ** 2
    return Belief(mean, sound_covariance(covariance))

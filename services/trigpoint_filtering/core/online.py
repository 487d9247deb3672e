"""One vehicle followed event by event: a fold over its wheel, IMU and GNSS samples in order of time."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import AlignmentRefused
from trigpoint.geodesy.poses import Pose2
from trigpoint.geodesy.positions import MapPosition
from trigpoint_filtering.core.estimator import Belief, rested, sound_covariance
from trigpoint_filtering.core.following import (
    ORIGIN,
    Following,
    Track,
    antenna_pose,
    base_speed_mps,
    best_calibration,
    gnss_noise,
    grown,
    told,
    unjudged,
)
from trigpoint_filtering.core.gate import INITIALISED, SECONDS_PER_NS, Fix, Hypothesis
from trigpoint_filtering.core.initialisation import Seeker, after_pair, prior_calibration
from trigpoint_filtering.core.motion import (
    HEADING,
    SPEED_SCALE,
    TURN_BIAS,
    MotionStep,
    TurnSource,
    X,
    Y,
    moved,
    step_variance,
)
from trigpoint_filtering.core.odometer import (
    Odometer,
    advanced,
    after_imu_sample,
    after_wheel_sample,
    silent_s,
    taken_step,
)
from trigpoint_filtering.core.rivalry import gated

Floats = NDArray[np.float64]

LATE = "late"
UNINITIALISED = "not initialised"

LOST_AFTER_S = 30.0  # without wheels nothing is left of a dead-reckoned position
LATE_LIMIT_S = 1.0  # a fix later than this is not worth moving forward


def after_wheel(track: Track, speed_mps: float, *, steering_rad: float, yaw_rate_radps: float, stamp_ns: int) -> Track:
    """The track after a wheel sample; steering and yaw rate NaN where not measured."""
    odometer = after_wheel_sample(
        track.odometer, speed_mps, steering_rad=steering_rad, yaw_rate_radps=yaw_rate_radps, stamp_ns=stamp_ns
    )
    return with_odometer(track, odometer)


def after_imu(track: Track, yaw_rate_radps: float, *, stamp_ns: int) -> Track:
    """The track after an IMU sample."""
    return with_odometer(track, after_imu_sample(track.odometer, yaw_rate_radps, stamp_ns=stamp_ns))


def with_odometer(track: Track, odometer: Odometer) -> Track:
    """The track with new samples in its odometer, and a step taken if one is due."""
    if is_step_due(track.following, odometer):
        return _stepped(track, odometer)
    return replace(track, odometer=odometer, verdict=None, alarm=None)


def is_step_due(following: Following, odometer: Odometer) -> bool:
    """Whether the pending motion makes a whole step; a microsecond short is whole (10 Hz against 0.2 s)."""
    return odometer.pending.s >= following.settings.max_step_s - 1e-6


def _stepped(track: Track, odometer: Odometer) -> Track:
    """The track with the odometer's pending motion taken into its hypotheses and its dead reckoning."""
    step, odometer = taken_step(odometer)
    if step is None:
        return replace(track, odometer=odometer, verdict=None, alarm=None)
    if step.source is not track.source:
        track = _calibrated_for(track, step.source)
    blind_s = max(step.blind_s, silent_s(odometer, odometer.stamp_ns))
    if blind_s > LOST_AFTER_S:
        track = _lost(track, f"no wheel speed for {blind_s:.0f} s: {LOST_AFTER_S:.0f} s is the limit")
    hypothesis, alternate = track.hypothesis, track.alternate
    return replace(
        track,
        odometer=odometer,
        step=step,
        believed_ns=odometer.stamp_ns,
        hypothesis=_predicted(track, hypothesis, step) if hypothesis else None,
        alternate=_predicted(track, alternate, step) if alternate else None,
        seeker=_reckoned(track, step),
        calibration=_rested_calibration(track, step),
        verdict=None,
        alarm=None,
    )


def _rested_calibration(track: Track, step: MotionStep) -> Belief | None:
    if track.calibration is None or track.hypothesis is not None or not step.standing:
        return track.calibration
    return rested(track.calibration, step)


def _lost(track: Track, refusal: str) -> Track:
    """The track sought anew, with the calibration it had."""
    return replace(
        track,
        hypothesis=None,
        alternate=None,
        deposed_ns=0,
        seeker=Seeker(ORIGIN),
        calibration=best_calibration(track),
        refusal=refusal,
    )


def _predicted(track: Track, hypothesis: Hypothesis, step: MotionStep) -> Hypothesis:
    belief = track.following.estimator.predicted(hypothesis.belief, step, track.noise)
    belief = rested(belief, step) if step.standing else belief
    odometer_m = hypothesis.odometer_m + abs(step.speed_mps) * step.dt_s
    return replace(hypothesis, belief=belief, odometer_m=odometer_m)


def _reckoned(track: Track, step: MotionStep) -> Seeker | None:
    """The seeker moved by dead reckoning."""
    if track.seeker is None:
        return None
    at = track.seeker.T_local_base
    state = best_calibration(track).mean.copy()
    state[[X, Y, HEADING]] = at.x_m, at.y_m, at.heading_rad
    after = moved(state[None, :], step, track.following.geometry, bias_time_s=track.noise.bias_time_s)[0]
    variance = step_variance(
        step,
        track.following.geometry,
        gnss_bias_sigma_m=track.noise.bias_sigma_m,
        bias_time_s=track.noise.bias_time_s,
    )
    return Seeker(
        Pose2(float(after[X]), float(after[Y]), float(after[HEADING])),
        track.seeker.pairs,
        track.seeker.drift_rad2 + float(variance[HEADING]),
    )


def _calibrated_for(track: Track, source: TurnSource) -> Track:
    """The track with calibration states that belong to the turn source now in use."""
    following = track.following
    prior = prior_calibration(source, following.geometry, antenna_sigma_m=following.settings.antenna_sigma_m)
    if track.calibration is None:
        return replace(track, source=source, calibration=prior)
    hypothesis = track.hypothesis
    return replace(
        track,
        source=source,
        calibration=_with_turn_of(track.calibration, prior),
        hypothesis=replace(hypothesis, belief=_with_turn_of(hypothesis.belief, prior)) if hypothesis else None,
        alternate=None,
    )


def _with_turn_of(belief: Belief, prior: Belief) -> Belief:
    mean, covariance = belief.mean.copy(), belief.covariance.copy()
    turn = slice(SPEED_SCALE + 1, TURN_BIAS + 1)
    mean[turn] = prior.mean[turn]
    covariance[turn, :] = 0.0
    covariance[:, turn] = 0.0
    covariance[turn, turn] = prior.covariance[turn, turn]
    return Belief(mean, sound_covariance(covariance))


def after_fix(track: Track, position: MapPosition, *, stamp_ns: int, sigma_m: float, sequence: int) -> Track:
    """The track after a fix, with its verdict on it; `sigma_m` NaN where the receiver declares none."""
    late_s = (track.odometer.stamp_ns - stamp_ns) * SECONDS_PER_NS
    noise = gnss_noise(sigma_m, track.following.settings)
    track = replace(_stepped(track, advanced(track.odometer, stamp_ns)), noise=noise, fix_ns=stamp_ns)
    point_m = np.array([position.x_m, position.y_m])
    if late_s > LATE_LIMIT_S or not np.all(np.isfinite(point_m)):
        return told(track, unjudged(LATE), sequence)
    if track.hypothesis is None:
        return _sought(track, Fix(stamp_ns, point_m, noise), sequence)
    forward = _moved_forward(track, track.hypothesis, point_m, late_s) if late_s > 0.0 else point_m
    return gated(track, track.hypothesis, Fix(max(stamp_ns, track.odometer.stamp_ns), forward, noise), sequence)


def _moved_forward(track: Track, hypothesis: Hypothesis, point_m: Floats, late_s: float) -> Floats:
    heading_rad = float(hypothesis.belief.mean[HEADING])
    way_m = late_s * base_speed_mps(track)
    return point_m + way_m * np.array([math.cos(heading_rad), math.sin(heading_rad)])


def _sought(track: Track, fix: Fix, sequence: int) -> Track:
    """The track while it has no position: one more fix laid along the way driven."""
    calibration = track.calibration
    if calibration is None or track.seeker is None:
        return told(replace(track, refusal="no wheel speed with a yaw rate"), unjudged(UNINITIALISED), sequence)
    seeker = after_pair(track.seeker, fix.point_m, antenna=antenna_pose(track))
    track = replace(track, seeker=seeker)
    try:
        found = grown(track, seeker, fix, calibration)
    except AlignmentRefused as refusal:
        return told(replace(track, refusal=str(refusal)), unjudged(UNINITIALISED), sequence)
    return told(replace(track, hypothesis=found, seeker=None, refusal=""), unjudged(INITIALISED), sequence)

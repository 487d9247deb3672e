"""One vehicle followed event by event: a fold over its wheel, IMU and GNSS samples in order of time.

Holds two hypotheses while fixes contradict the one it reports: a second one grows from the contradicting
fixes alone, and takes over only when its evidence outweighs the first's.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from trigpoint.errors import AlignmentRefused
from trigpoint.events.estimated import FixJudged, GateAlarmed
from trigpoint.events.observed import VehicleDescribed
from trigpoint.geodesy.poses import Pose2
from trigpoint.geodesy.positions import MapPosition
from trigpoint_filtering.core.estimator import Belief, Estimator, GnssNoise, rested, sound_covariance
from trigpoint_filtering.core.gate import (
    INITIALISED,
    OUTAGE,
    REACQUIRED,
    RUN_FIXES,
    SECONDS_PER_NS,
    Fix,
    Hypothesis,
    Verdict,
    drift_bound_m,
    has_lost_heading,
    judged,
)
from trigpoint_filtering.core.initialisation import Seeker, after_pair, aligned, placed, prior_calibration
from trigpoint_filtering.core.motion import (
    HEADING,
    SPEED_SCALE,
    TURN_BIAS,
    Geometry,
    MotionStep,
    TurnSource,
    X,
    Y,
    base_motion,
    geometry_of,
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
from trigpoint_filtering.settings import FilterSettings

LATE = "late"
UNINITIALISED = "not initialised"

LOST_AFTER_S = 30.0  # without wheels nothing is left of a dead-reckoned position
LATE_LIMIT_S = 1.0  # a fix later than this is not worth moving forward
SUPPORT_S = (30.0, 120.0)  # a second hypothesis needs as much as the first had, within these bounds
NEAR_SUPPORT_S = 25.0  # for one that the first may have drifted from
SUPPORT_FIXES_PER_S = 0.3  # accepted, of those seconds
ALTERNATE_REJECTIONS = 10  # in a row end a second hypothesis
FORMER_KEPT_S = 300.0  # a deposed hypothesis may come back for this long
DEAF_S = 60.0  # of rejections only
DEAF_FIXES = 20
GATE_USELESS_M = 100.0  # radius of a gate that could reject next to nothing
DEAF_REASON = "every fix rejected"
USELESS_REASON = "gate too wide to reject"


@dataclass(frozen=True, slots=True)
class Following:
    """What stays the same along a track: whose it is, its geometry, estimator, settings and gate limit."""

    vehicle: str
    boot_id: str
    geometry: Geometry
    estimator: Estimator
    settings: FilterSettings
    limit: float


@dataclass(frozen=True, slots=True)
class Track:
    """Everything known of a vehicle after an event; `verdict` and `alarm` are what that event brought, if anything.

    `hypothesis` is None until position and heading are found; then `seeker` is None unless fixes are being rejected.
    """

    following: Following
    odometer: Odometer
    noise: GnssNoise
    seeker: Seeker | None
    hypothesis: Hypothesis | None = None
    alternate: Hypothesis | None = None
    deposed_ns: int = 0
    calibration: Belief | None = None
    source: TurnSource | None = None
    step: MotionStep | None = None
    believed_ns: int = 0
    alarmed: tuple[str, ...] = ()
    verdict: FixJudged | None = None
    alarm: GateAlarmed | None = None
    refusal: str = "no fixes"


def started_track(
    described: VehicleDescribed, *, boot_id: str, point_scale: float, settings: FilterSettings
) -> Track:
    """The track of a vehicle that has measured nothing yet."""
    geometry = geometry_of(described, point_scale=point_scale)
    limit = float(chi2.ppf(settings.gate_probability, 2))
    following = Following(described.vehicle, boot_id, geometry, Estimator(geometry), settings, limit)
    return Track(following, Odometer(described.wheelbase_m > 0.0), gnss_noise(math.nan, settings), Seeker(ORIGIN))


ORIGIN = Pose2(0.0, 0.0, 0.0)


def gnss_noise(sigma_m: float, settings: FilterSettings) -> GnssNoise:
    """A fix's noise from its declared sigma, NaN or 0 where none, between the floor and the cap."""
    declared_m = sigma_m if math.isfinite(sigma_m) and sigma_m > 0.0 else settings.gnss_sigma_m
    total_m = min(max(declared_m, settings.gnss_sigma_floor_m), settings.gnss_sigma_cap_m)
    white_m = settings.gnss_white_share * total_m
    return GnssNoise(white_m, math.sqrt(max(total_m**2 - white_m**2, 0.0)), settings.gnss_bias_time_s)


def after_wheel(
    track: Track, speed_mps: float, *, steering_rad: float, yaw_rate_radps: float, stamp_ns: int
) -> Track:
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
    track = replace(track, odometer=odometer, verdict=None, alarm=None)
    return _stepped(track) if is_step_due(track.following, odometer) else track


def is_step_due(following: Following, odometer: Odometer) -> bool:
    """Whether the pending motion makes a whole step; a microsecond short is whole (10 Hz against 0.1 s)."""
    return odometer.pending.s >= following.settings.max_step_s - 1e-6


def _stepped(track: Track) -> Track:
    """The track with the pending motion taken into its hypotheses and its dead reckoning."""
    step, odometer = taken_step(track.odometer)
    if step is None:
        return replace(track, odometer=odometer)
    track = _calibrated_for(replace(track, odometer=odometer, step=step, believed_ns=odometer.stamp_ns), step.source)
    blind_s = max(step.blind_s, silent_s(odometer, odometer.stamp_ns))
    if blind_s > LOST_AFTER_S:
        return _lost(track, f"no wheel speed for {blind_s:.0f} s: {LOST_AFTER_S:.0f} s is the limit")
    hypothesis, alternate = track.hypothesis, track.alternate
    return replace(
        track,
        hypothesis=_predicted(track, hypothesis, step) if hypothesis else None,
        alternate=_predicted(track, alternate, step) if alternate else None,
        seeker=_reckoned(track, step),
        calibration=_rested_calibration(track, step),
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
        calibration=_best_calibration(track),
        refusal=refusal,
    )


def _predicted(track: Track, hypothesis: Hypothesis, step: MotionStep) -> Hypothesis:
    belief = track.following.estimator.predicted(hypothesis.belief, step, track.noise)
    belief = rested(belief, step) if step.standing else belief
    odometer_m = hypothesis.odometer_m + abs(step.speed_mps) * step.dt_s
    return replace(hypothesis, belief=belief, odometer_m=odometer_m)


def _best_calibration(track: Track) -> Belief:
    belief = track.hypothesis.belief if track.hypothesis else track.calibration
    assert belief is not None, "set with the first step"
    return belief


def base_speed_mps(track: Track) -> float:
    """Speed of the base over the last step taken, 0 before the first."""
    if track.step is None:
        return 0.0
    speed_mps, _ = base_motion(_best_calibration(track).mean, track.step, track.following.geometry)
    return float(speed_mps)


def _reckoned(track: Track, step: MotionStep) -> Seeker | None:
    """The seeker moved by dead reckoning."""
    if track.seeker is None:
        return None
    at = track.seeker.T_local_base
    state = _best_calibration(track).mean.copy()
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
    if track.source is source:
        return track
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
    track = replace(track, odometer=advanced(track.odometer, stamp_ns), noise=noise, alarm=None)
    track = _stepped(track)
    point_m = np.array([position.x_m, position.y_m])
    if late_s > LATE_LIMIT_S or not np.all(np.isfinite(point_m)):
        return _told(track, _unjudged(LATE), sequence)
    if track.hypothesis is None:
        return _sought(track, Fix(stamp_ns, point_m, noise), sequence)
    forward = _moved_forward(track, track.hypothesis, point_m, late_s) if late_s > 0.0 else point_m
    return _gated(track, track.hypothesis, Fix(max(stamp_ns, track.odometer.stamp_ns), forward, noise), sequence)


def _moved_forward(track: Track, hypothesis: Hypothesis, point_m: np.ndarray, late_s: float) -> np.ndarray:  # type: ignore[type-arg]
    heading_rad = float(hypothesis.belief.mean[HEADING])
    way_m = late_s * base_speed_mps(track)
    return point_m + way_m * np.array([math.cos(heading_rad), math.sin(heading_rad)])


def _unjudged(reason: str) -> Verdict:
    return Verdict(reason == INITIALISED, reason, math.nan, np.full(2, math.nan), 0.0)


def _told(track: Track, verdict: Verdict, sequence: int) -> Track:
    following = track.following
    said = FixJudged(
        vehicle=following.vehicle,
        boot_id=following.boot_id,
        fix_sequence=sequence,
        accepted=verdict.accepted,
        reason=verdict.reason,
        nis=verdict.nis,
        limit=following.limit,
        innovation_x_m=float(verdict.innovation_m[0]),
        innovation_y_m=float(verdict.innovation_m[1]),
    )
    return replace(track, verdict=said)


def _antenna(track: Track) -> Pose2:
    geometry = track.following.geometry
    return Pose2(geometry.antenna_x_m, geometry.antenna_y_m, 0.0)


def _sought(track: Track, fix: Fix, sequence: int) -> Track:
    """The track while it has no position: one more fix laid along the way driven."""
    if track.calibration is None or track.seeker is None:
        return _told(replace(track, refusal="no wheel speed with a yaw rate"), _unjudged(UNINITIALISED), sequence)
    seeker = after_pair(track.seeker, fix.point_m, antenna=_antenna(track))
    track = replace(track, seeker=seeker)
    try:
        found = _grown(track, seeker, fix, track.calibration)
    except AlignmentRefused as refusal:
        return _told(replace(track, refusal=str(refusal)), _unjudged(UNINITIALISED), sequence)
    return _told(replace(track, hypothesis=found, seeker=None), _unjudged(INITIALISED), sequence)


def _grown(track: Track, seeker: Seeker, fix: Fix, calibration: Belief) -> Hypothesis:
    """A hypothesis from a seeker's fixes alone. Raises AlignmentRefused."""
    alignment = aligned(seeker, sigma_m=fix.noise.white_sigma_m)
    T_map_base = alignment.T_map_local.compose(seeker.T_local_base)
    return Hypothesis(placed(calibration, T_map_base, alignment, fix.noise), fix.stamp_ns, fix.stamp_ns)


def _gated(track: Track, hypothesis: Hypothesis, fix: Fix, sequence: int) -> Track:
    """The track after its hypotheses have judged a fix."""
    following = track.following
    after, verdict = judged(hypothesis, fix, following.estimator, limit=following.limit)
    track = _told(replace(track, hypothesis=after), verdict, sequence)
    if track.deposed_ns:
        track = _with_former(track, fix, verdict)
    elif verdict.accepted:
        track = replace(track, alternate=None, seeker=None)
    else:
        track = _with_alternate(track, after, fix)
    return _alarmed(track, verdict, fix.stamp_ns)


def _with_alternate(track: Track, hypothesis: Hypothesis, fix: Fix) -> Track:
    """The track with its second hypothesis fed the fix that the first rejected."""
    if track.alternate is None:
        return _with_seeker(track, hypothesis, fix)
    following = track.following
    alternate, _ = judged(track.alternate, fix, following.estimator, limit=following.limit)
    if alternate.rejected_count >= ALTERNATE_REJECTIONS:
        return replace(track, alternate=None, seeker=None)
    if not _outweighs(alternate, hypothesis):
        return replace(track, alternate=alternate)
    return _swapped(track, alternate, hypothesis, fix)


def _swapped(track: Track, chosen: Hypothesis, deposed: Hypothesis, fix: Fix) -> Track:
    assert track.verdict is not None
    verdict = replace(track.verdict, accepted=True, reason=REACQUIRED)
    return replace(
        track, hypothesis=chosen, alternate=deposed, deposed_ns=fix.stamp_ns, seeker=None, verdict=verdict
    )


def _with_seeker(track: Track, hypothesis: Hypothesis, fix: Fix) -> Track:
    """The track with the rejected fix laid along the way driven since rejections began."""
    mean = hypothesis.belief.mean
    seeker = track.seeker or Seeker(Pose2(float(mean[X]), float(mean[Y]), float(mean[HEADING])))
    seeker = after_pair(seeker, fix.point_m, antenna=_antenna(track))
    try:
        alternate = _grown(track, seeker, fix, hypothesis.belief)
    except AlignmentRefused:
        return replace(track, seeker=seeker)
    return replace(track, seeker=None, alternate=alternate)


def _outweighs(alternate: Hypothesis, hypothesis: Hypothesis) -> bool:
    """Whether the second hypothesis has agreed with the fixes for long, and the first with none meanwhile.

    Where the first has lost its heading or may have drifted to the second, a short agreement is enough; else it must be as long as
    the first's own was, within bounds.
    """
    had_s = (hypothesis.accepted_ns - hypothesis.born_ns) * SECONDS_PER_NS
    needed_s = min(max(had_s, SUPPORT_S[0]), SUPPORT_S[1])
    if has_lost_heading(hypothesis) or _is_near(alternate, hypothesis):
        needed_s = NEAR_SUPPORT_S
    support_s = (alternate.accepted_ns - alternate.born_ns) * SECONDS_PER_NS
    alone = hypothesis.accepted_ns <= alternate.born_ns
    return alone and support_s >= needed_s and alternate.accepted_count >= needed_s * SUPPORT_FIXES_PER_S


def _is_near(alternate: Hypothesis, hypothesis: Hypothesis) -> bool:
    sigma_m = math.sqrt(float(hypothesis.belief.covariance.diagonal()[X : Y + 1].max()))
    apart_m = float(np.hypot(*(alternate.belief.mean[X : Y + 1] - hypothesis.belief.mean[X : Y + 1])))
    return apart_m <= drift_bound_m(hypothesis, sigma_m)


def _with_former(track: Track, fix: Fix, verdict: Verdict) -> Track:
    """The track with its deposed hypothesis kept, brought back or let go."""
    former, following = track.alternate, track.following
    if former is None or (fix.stamp_ns - track.deposed_ns) * SECONDS_PER_NS > FORMER_KEPT_S:
        return replace(track, alternate=None, deposed_ns=0)
    after, former_verdict = judged(former, fix, following.estimator, limit=following.limit)
    assert track.hypothesis is not None
    if former_verdict.accepted and track.hypothesis.rejected_count >= RUN_FIXES:
        track = _swapped(track, after, track.hypothesis, fix)
        return replace(track, alternate=None, deposed_ns=0)
    if former_verdict.accepted and verdict.accepted:
        return replace(track, alternate=None, deposed_ns=0)
    return replace(track, alternate=after)


def _alarmed(track: Track, verdict: Verdict, stamp_ns: int) -> Track:
    """The track with an alarm if the gate has become deaf or useless, once until a fix is accepted."""
    hypothesis = track.hypothesis
    assert hypothesis is not None
    if verdict.accepted and verdict.gate_radius_m < GATE_USELESS_M:
        return replace(track, alarmed=())
    duration_s = (stamp_ns - hypothesis.accepted_ns) * SECONDS_PER_NS
    reasons = (
        (DEAF_REASON, duration_s >= DEAF_S and hypothesis.rejected_count >= DEAF_FIXES),
        (USELESS_REASON, verdict.gate_radius_m >= GATE_USELESS_M),
    )
    fresh = [reason for reason, holds in reasons if holds and reason not in track.alarmed]
    if not fresh:
        return track
    said = GateAlarmed(
        vehicle=track.following.vehicle, boot_id=track.following.boot_id, reason=fresh[0], duration_s=duration_s
    )
    return replace(track, alarm=said, alarmed=(*track.alarmed, fresh[0]))

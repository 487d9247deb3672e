"""What is known of a vehicle that is being followed, and how that begins."""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from trigpoint.events.estimated import FixJudged, GateAlarmed
from trigpoint.events.observed import VehicleDescribed
from trigpoint.geodesy.poses import Pose2
from trigpoint_filtering.core.estimator import Belief, Estimator, GnssNoise
from trigpoint_filtering.core.gate import INITIALISED, Fix, Hypothesis, Verdict
from trigpoint_filtering.core.initialisation import Seeker, aligned, placed
from trigpoint_filtering.core.motion import Geometry, MotionStep, TurnSource, base_motion, geometry_of
from trigpoint_filtering.core.odometer import Odometer
from trigpoint_filtering.settings import FilterSettings

ORIGIN = Pose2(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Following:
    """What stays the same along a track: whose it is, its geometry, estimator, settings, gate limit and track width."""

    vehicle: str
    boot_id: str
    geometry: Geometry
    estimator: Estimator
    settings: FilterSettings
    limit: float
    track_m: float


@dataclass(frozen=True, slots=True)
class Track:
    """Everything known of a vehicle after an event; `verdict` and `alarm` are what that event brought, if anything.

    `believed_ns` is the stamp of the belief, `fix_ns` of the newest fix. `hypothesis` is None until position and
    heading are found; then `seeker` is None unless fixes are being rejected. `refusal` says what is missing.
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
    fix_ns: int = 0
    alarmed: tuple[str, ...] = ()
    verdict: FixJudged | None = None
    alarm: GateAlarmed | None = None
    refusal: str = "no fixes"


def started_track(described: VehicleDescribed, *, boot_id: str, point_scale: float, settings: FilterSettings) -> Track:
    """The track of a vehicle that has measured nothing yet."""
    geometry = geometry_of(described, point_scale=point_scale)
    limit = float(chi2.ppf(settings.gate_probability, 2))
    following = Following(described.vehicle, boot_id, geometry, Estimator(geometry), settings, limit, described.track_m)
    return Track(following, Odometer(described.wheelbase_m > 0.0), gnss_noise(math.nan, settings), Seeker(ORIGIN))


def gnss_noise(sigma_m: float, settings: FilterSettings) -> GnssNoise:
    """A fix's noise from its declared sigma, NaN or 0 where none, between the floor and the cap."""
    declared_m = sigma_m if math.isfinite(sigma_m) and sigma_m > 0.0 else settings.gnss_sigma_m
    total_m = min(max(declared_m, settings.gnss_sigma_floor_m), settings.gnss_sigma_cap_m)
    white_m = settings.gnss_white_share * total_m
    return GnssNoise(white_m, math.sqrt(max(total_m**2 - white_m**2, 0.0)), settings.gnss_bias_time_s)


def best_calibration(track: Track) -> Belief:
    """The belief that knows most of the odometry's calibration; there is one from the first step on."""
    belief = track.hypothesis.belief if track.hypothesis else track.calibration
    assert belief is not None, "set with the first step"
    return belief


def base_speed_mps(track: Track) -> float:
    """Speed of the base over the last step taken, 0 before the first."""
    if track.step is None:
        return 0.0
    speed_mps, _ = base_motion(best_calibration(track).mean, track.step, track.following.geometry)
    return float(speed_mps)


def grown(track: Track, seeker: Seeker, fix: Fix, calibration: Belief) -> Hypothesis:
    """A hypothesis from a seeker's fixes alone. Raises AlignmentRefused."""
    alignment = aligned(seeker, sigma_m=fix.noise.white_sigma_m)
    T_map_base = alignment.T_map_local.compose(seeker.T_local_base)
    return Hypothesis(placed(calibration, T_map_base, alignment, fix.noise), fix.stamp_ns, fix.stamp_ns)


def antenna_pose(track: Track) -> Pose2:
    """The antenna in the base frame, as described."""
    geometry = track.following.geometry
    return Pose2(geometry.antenna_x_m, geometry.antenna_y_m, 0.0)


def told(track: Track, verdict: Verdict, sequence: int) -> Track:
    """The track with a verdict on the fix of that sequence."""
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


def unjudged(reason: str) -> Verdict:
    """The verdict on a fix that no hypothesis has judged."""
    return Verdict(reason == INITIALISED, reason, math.nan, np.full(2, math.nan), 0.0)

"""Random places on true paths, what a vehicle observes there, and how well it finds itself in a map by that.

The observations are made of true landmarks, with noise, unmapped clutter and a wide prior; the map is the one under
test, so its own errors count. Truth is never used to find the place.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.client.core.constellations import Constellation
from trigpoint.client.core.motion_fit import Expectation, PositionPrior
from trigpoint.client.core.relocalisation import Relocalised, Verdict, relocalised
from trigpoint.errors import InputError
from trigpoint.geodesy.poses import wrap_angle_rad
from trigpoint_evaluation.core.landmark_truth import Matches
from trigpoint_evaluation.core.summary import ErrorSummary, summary_of

Floats = NDArray[np.float64]
Finder = Callable[[Constellation, Constellation, PositionPrior, Expectation], Relocalised | None]

NEAR_M, FAR_M = 0.5, 2.0
DRAWS_MOST = 100  # of places for each one wanted: where so many show too few landmarks there are none


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialSettings:
    """How many places, what is observed at each, and how well. The defaults are a small vehicle's lidar."""

    places: int = 1000
    seed: int = 0
    prior_sigma_m: float = 15.0
    observed_least: int = 5
    observed_most: int = 8
    clutter_share: float = 0.2  # of everything observed
    range_m: float = 30.0
    range_sigma_m: float = 0.07
    bearing_sigma_rad: float = 0.007

    def __post_init__(self) -> None:
        if self.places < 1:
            raise InputError(f"{self.places} places: at least 1 is needed")
        if not 0.0 <= self.clutter_share < 1.0:
            raise InputError(f"clutter share {self.clutter_share} is outside 0 to 1")
        if not 2 <= self.observed_least <= self.observed_most:
            raise InputError(f"{self.observed_least} to {self.observed_most} landmarks observed: at least 2, in order")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueWorld:
    """True landmarks point_m (t, 2) of kind (t,) and true poses (p, 3) in the map frame; map_error_m (t, 2): where the
    map has each landmark less where it is, NaN where the map does not have it."""

    point_m: Floats
    kind: tuple[str, ...]
    poses: Floats
    map_error_m: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A true pose (3,), how far (2,) the map is off around it, what is observed there, and the prior."""

    pose: Floats
    map_error_m: Floats
    observed: Constellation
    prior: PositionPrior


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """What came of one place: error in m and rad, NEES over 3, all NaN where nothing was found.

    `error_in_map_m` is the error that is left when the map's own, of the landmarks around, is taken out.
    """

    verdict: Verdict | None
    error_m: float
    error_in_map_m: float
    error_rad: float
    nees_per_dof: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialResult:
    """The shares of places answered with confidence, ambiguous, unsupported and not found at all; and of the confident
    answers the errors against truth and within the map, the shares of each within 0.5 m, how many are off by over 2 m
    against truth, and the consistency."""

    places: int
    confident: float
    ambiguous: float
    unsupported: float
    not_found: float
    error_m: ErrorSummary
    error_in_map_m: ErrorSummary
    heading_error_rad: ErrorSummary
    within_half_a_metre: float
    within_half_a_metre_in_map: float
    off_by_2_m: int
    nees_per_dof: float


def kinds_by_match(kind: Sequence[str], matches: Matches, count: int, rng: np.random.Generator) -> tuple[str, ...]:
    """The kinds of `count` true landmarks: those of their like in the map, for the rest any that the map has."""
    drawn = np.array(kind, dtype=object)[rng.integers(len(kind), size=count)]
    drawn[matches.truth] = np.array(kind, dtype=object)[matches.estimated]
    return tuple(map(str, drawn))


def trial_places(world: TrueWorld, settings: TrialSettings) -> Iterator[Place]:
    """The places of a trial: the same for the same seed.

    Raises InputError where next to no pose has enough landmarks within range.
    """
    rng = np.random.default_rng([settings.seed, 31])
    found = 0
    for _ in range(DRAWS_MOST * settings.places):
        pose = world.poses[rng.integers(len(world.poses))]
        place = _observed_at(pose, world, settings, rng)
        if place is not None:
            found += 1
            yield place
        if found == settings.places:
            return
    raise InputError(
        f"{found} of {DRAWS_MOST * settings.places} poses have {settings.observed_least} landmarks within "
        f"{settings.range_m:g} m: {settings.places} are wanted"
    )


def _observed_at(pose: Floats, world: TrueWorld, settings: TrialSettings, rng: np.random.Generator) -> Place | None:
    visible = np.flatnonzero(np.hypot(*(world.point_m - pose[:2]).T) < settings.range_m)
    if len(visible) < settings.observed_least:
        return None
    count = min(len(visible), int(rng.integers(settings.observed_least, settings.observed_most + 1)))
    chosen = rng.choice(visible, count, replace=False)
    clutter = round(count * settings.clutter_share / (1.0 - settings.clutter_share))
    away_m = world.point_m[chosen] - pose[:2]
    range_m = np.hypot(*away_m.T) + rng.normal(0.0, settings.range_sigma_m, count)
    bearing_rad = np.arctan2(away_m[:, 1], away_m[:, 0]) - pose[2]
    bearing_rad = bearing_rad + rng.normal(0.0, settings.bearing_sigma_rad, count)
    range_m = np.concatenate([range_m, settings.range_m * np.sqrt(rng.random(clutter))])
    bearing_rad = np.concatenate([bearing_rad, rng.uniform(-math.pi, math.pi, clutter)])
    kinds = [world.kind[number] for number in (*chosen, *rng.integers(len(world.kind), size=clutter))]
    prior_m = pose[:2] + rng.normal(0.0, settings.prior_sigma_m, 2)
    return Place(
        pose=pose,
        map_error_m=_mean_known(world.map_error_m[visible]),
        observed=_constellation(range_m, bearing_rad, kinds, settings),
        prior=PositionPrior(point_m=prior_m, sigma_m=settings.prior_sigma_m),
    )


def _mean_known(error_m: Floats) -> Floats:
    """The mean (2,) of errors (n, 2), those that are NaN left out; NaN where all are."""
    known = error_m[np.isfinite(error_m).all(axis=1)]
    mean: Floats = known.mean(axis=0) if len(known) else np.full(2, np.nan)
    return mean


def _constellation(
    range_m: Floats, bearing_rad: Floats, kinds: Sequence[str], settings: TrialSettings
) -> Constellation:
    """Ranges (n,) and bearings (n,) as points in the base's frame."""
    ahead = np.stack([np.cos(bearing_rad), np.sin(bearing_rad)], axis=-1)
    aside = np.stack([-ahead[:, 1], ahead[:, 0]], axis=-1)
    along_m2 = settings.range_sigma_m**2 * np.einsum("ni,nj->nij", ahead, ahead)
    across_m2 = np.einsum("n,ni,nj->nij", (settings.bearing_sigma_rad * range_m) ** 2, aside, aside)
    return Constellation(point_m=range_m[:, None] * ahead, covariance_m2=along_m2 + across_m2, kind=tuple(kinds))


def expected_of(settings: TrialSettings) -> Expectation:
    """What such a sensor is expected to see beside landmarks: one thing in a hundred in no map, at the least."""
    mean = 0.5 * (settings.observed_least + settings.observed_most)
    clutter = max(0.01, settings.clutter_share / (1.0 - settings.clutter_share)) * mean
    return Expectation(clutter_per_m2=clutter / (math.pi * settings.range_m**2), detected=0.7)


def trial_findings(
    places: Iterator[Place], known: Constellation, settings: TrialSettings, *, find: Finder = relocalised
) -> Iterator[Finding]:
    """What comes of each place."""
    expected = expected_of(settings)
    for place in places:
        found = find(place.observed, known, place.prior, expected)
        yield finding_at(found, place.pose, map_error_m=place.map_error_m)


def finding_at(found: Relocalised | None, pose: Floats, *, map_error_m: Floats) -> Finding:
    """What came of looking for a true pose (3,) where the map is off by map_error_m (2,)."""
    if found is None:
        return Finding(
            verdict=None, error_m=math.nan, error_in_map_m=math.nan, error_rad=math.nan, nees_per_dof=math.nan
        )
    off = found.T_map_base - pose
    off[2] = wrap_angle_rad(float(off[2]))
    return Finding(
        verdict=found.verdict,
        error_m=float(np.hypot(off[0], off[1])),
        error_in_map_m=float(np.hypot(*(off[:2] - map_error_m))),
        error_rad=abs(float(off[2])),
        nees_per_dof=float(off @ np.linalg.solve(found.covariance, off)) / 3.0,
    )


def trial_result(findings: Sequence[Finding]) -> TrialResult:
    """All places together."""
    sure = [one for one in findings if one.verdict is Verdict.CONFIDENT]
    error_m = np.array([one.error_m for one in sure])
    in_map_m = np.array([one.error_in_map_m for one in sure])

    def share(verdict: Verdict | None) -> float:
        return sum(one.verdict is verdict for one in findings) / len(findings)

    return TrialResult(
        places=len(findings),
        confident=share(Verdict.CONFIDENT),
        ambiguous=share(Verdict.AMBIGUOUS),
        unsupported=share(Verdict.UNSUPPORTED),
        not_found=share(None),
        error_m=summary_of(error_m),
        error_in_map_m=summary_of(in_map_m),
        heading_error_rad=summary_of(np.array([one.error_rad for one in sure])),
        within_half_a_metre=_share_within(error_m, NEAR_M),
        within_half_a_metre_in_map=_share_within(in_map_m, NEAR_M),
        off_by_2_m=int(np.count_nonzero(error_m > FAR_M)),
        nees_per_dof=float(np.mean([one.nees_per_dof for one in sure])) if sure else math.nan,
    )


def _share_within(error_m: Floats, limit_m: float) -> float:
    """The share of known errors within a limit, NaN without any."""
    known = error_m[np.isfinite(error_m)]
    return float(np.mean(known <= limit_m)) if len(known) else math.nan

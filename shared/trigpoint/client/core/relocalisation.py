"""Where a vehicle is, from a handful of landmarks it observes and a prior tens of metres wide.

Pairs of landmarks propose motions, the best of them are fitted to all, and each place's evidence (one landmark's
likelihood against clutter's, times the volume of poses it leaves, Laplace 1774; MacKay 2003, ch. 28) is weighed against
every other place's and against everything being clutter. An answer is given only where the rest is next to impossible.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from trigpoint.client.core.constellations import Constellation, same_kind
from trigpoint.client.core.motion_fit import Expectation, FittedMotion, PositionPrior, fitted_motion
from trigpoint.client.core.motion_proposals import proposed_motions
from trigpoint.geodesy.poses import transform_points, wrap_angles_rad
from trigpoint.geodesy.uncertainty import floored_covariance

Floats = NDArray[np.float64]

REACH = 4.0  # sigmas of the prior within which places are looked for
RISK_LIMIT = 1e-4  # probability of being elsewhere or nowhere, with which an answer is still given
MATCHED_LEAST = 4  # landmarks an answer rests on
MATCHED_SHARE = 0.5  # of the landmarks observed, at least
PRECISE_SIGMA_M = 0.2  # of the position among its landmarks: the widest an answer may be
LOCAL_SIGMA_M = 0.05  # of mapped landmarks against their neighbours
SHARED = 0.9  # of the smallest covariance around, which neighbours have in common
FITTED_MOST = 16  # places fitted
DIFFERENT_M, DIFFERENT_RAD = 0.5, 0.1  # nearer motions are one place
PROPOSAL_WIDTH = 4.0  # how much wider residuals of a motion from two landmarks are
PROPOSAL_GAIN = 8.0  # what one landmark that fits is worth among proposals, as a log-likelihood ratio


class Verdict(Enum):
    """Whether a place may be relied on."""

    CONFIDENT = "confident"
    AMBIGUOUS = "ambiguous"  # another place, or none, is not unlikely enough
    UNSUPPORTED = "unsupported"  # too few landmarks fit, or too badly, or they leave the position too wide


@dataclass(frozen=True, slots=True, kw_only=True)
class Relocalised:
    """The likeliest pose T_map_base (3,): x, y in m, heading in rad, with covariance (3, 3); the pairs (k, 2) of
    observed and known landmarks it rests on; the probability that it is wrong; and whether to rely on it."""

    T_map_base: Floats
    covariance: Floats
    pairs: NDArray[np.int64]
    risk: float
    verdict: Verdict


def relocalised(
    observed: Constellation, known: Constellation, prior: PositionPrior, expected: Expectation
) -> Relocalised | None:
    """The pose of a base that observes landmarks (in its own frame) among those known (in the map); None where no
    three of them fit any place within the prior's reach."""
    reach_m = REACH * prior.sigma_m + float(np.hypot(*observed.point_m.T).max(initial=0.0))
    within = np.hypot(*(known.point_m - prior.point_m).T) <= reach_m
    shared_m2, relative = _without_shared(known.only(within))
    places = _places(observed, relative, prior, expected)
    if not places:
        return None
    best = places[0]
    covariance = best.covariance.copy()
    covariance[:2, :2] += shared_m2
    risk = _risk([place.log_evidence for place in places])
    number = np.nonzero(within)[0]
    return Relocalised(
        T_map_base=np.array([*best.motion[:2], *wrap_angles_rad(best.motion[2:])]),
        covariance=covariance,
        pairs=np.column_stack([best.pairs[:, 0], number[best.pairs[:, 1]]]),
        risk=risk,
        verdict=_verdict(best, risk, len(observed)),
    )


def _without_shared(known: Constellation) -> tuple[Floats, Constellation]:
    """The error (2, 2) that landmarks around have in common, which says nothing of their places among themselves, and
    the landmarks with what is left of their covariances."""
    if not len(known):
        return np.zeros((2, 2)), known
    least = int(np.argmin(np.trace(known.covariance_m2, axis1=1, axis2=2)))
    shared_m2 = SHARED * known.covariance_m2[least]
    floor_m2 = LOCAL_SIGMA_M**2
    own_m2 = np.array([floored_covariance(each - shared_m2, floor=floor_m2) for each in known.covariance_m2])
    return shared_m2, Constellation(point_m=known.point_m, covariance_m2=own_m2, kind=known.kind)


def _places(
    observed: Constellation, known: Constellation, prior: PositionPrior, expected: Expectation
) -> list[FittedMotion]:
    """Different places, the likeliest first."""
    if min(len(observed), len(known)) < 2:
        return []
    motions = proposed_motions(observed, known)
    motions = motions[prior.chi_square(motions) <= REACH**2]
    if not len(motions):
        return []
    score = _scores(motions, observed, known) - 0.5 * prior.chi_square(motions)
    tried = _different(motions[np.argsort(-score, kind="stable")], most=FITTED_MOST)
    fitted = [found for motion in tried if (found := fitted_motion(motion, observed, known, prior, expected))]
    return _likeliest_each(sorted(fitted, key=lambda found: -found.log_evidence))


def _likeliest_each(fitted: Sequence[FittedMotion]) -> list[FittedMotion]:
    """The first of each place, in order."""
    found: list[FittedMotion] = []
    for one in fitted:
        if not any(_is_near(one.motion - other.motion) for other in found):
            found.append(one)
    return found


def _scores(motions: Floats, observed: Constellation, known: Constellation) -> Floats:
    """How well motions (k, 3) lay the observed landmarks on known ones (k,)."""
    laid_m = transform_points(motions[:, None], observed.point_m[None])
    off_m2 = ((laid_m[:, :, None] - known.point_m) ** 2).sum(axis=-1)
    nearest_m2 = np.where(same_kind(observed, known), off_m2, np.inf).min(axis=-1)
    variance_m2 = 0.5 * np.trace(observed.covariance_m2, axis1=1, axis2=2) + LOCAL_SIGMA_M**2
    scores: Floats = np.maximum(0.0, PROPOSAL_GAIN - 0.5 * nearest_m2 / (PROPOSAL_WIDTH * variance_m2)).sum(axis=1)
    return scores


def _different(motions: Floats, *, most: int) -> list[Floats]:
    """The first of each place among motions (k, 3), in order, at most so many."""
    left = motions
    found: list[Floats] = []
    while len(left) and len(found) < most:
        found.append(left[0])
        left = left[~_is_near(left - left[0])]
    return found


def _is_near(off: Floats) -> NDArray[np.bool_]:
    """Whether motions that differ by (..., 3) are of one place."""
    near_m = np.hypot(off[..., 0], off[..., 1]) < DIFFERENT_M
    return np.asarray(near_m & (np.abs(wrap_angles_rad(off[..., 2])) < DIFFERENT_RAD))


def _risk(log_evidence: Sequence[float]) -> float:
    """The probability that the first of some places is not the right one: the others' share, and clutter's, whose
    log-evidence is 0."""
    others = np.logaddexp.reduce([0.0, *log_evidence[1:]])
    return float(1.0 / (1.0 + math.exp(min(700.0, log_evidence[0] - float(others)))))


def _verdict(best: FittedMotion, risk: float, observed_count: int) -> Verdict:
    matched = len(best.pairs)
    enough = matched >= max(MATCHED_LEAST, MATCHED_SHARE * observed_count)
    widest_m2 = float(np.linalg.eigvalsh(best.covariance[:2, :2])[-1])
    fits = best.chi_square <= _chi_square_limit(2 * matched - 3)
    if not enough or not fits or widest_m2 > PRECISE_SIGMA_M**2:
        return Verdict.UNSUPPORTED
    return Verdict.CONFIDENT if risk <= RISK_LIMIT else Verdict.AMBIGUOUS


def _chi_square_limit(freedom: int) -> float:
    """The 99.9 % quantile of chi-square (Wilson and Hilferty 1931)."""
    spread = 2.0 / (9.0 * freedom)
    return float(freedom * (1.0 - spread + 3.0902 * math.sqrt(spread)) ** 3)

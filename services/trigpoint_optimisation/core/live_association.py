"""Which landmark a track is of, when the map is known so well and no better: one of them, a new one, or no answer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

GATE = 9.21  # chi-square, 2 degrees of freedom, 99 %
FAR_GATE = 18.4  # 99.99 %: beyond, it is surely another
RIVAL_MARGIN = 9.21  # the next candidate must be so much further, in chi-square
TIGHT_M = 1.0  # 1-sigma of the expectation: where it is wider, one landmark alone proves nothing
SAME_M = 0.9  # so near to a landmark nothing new stands


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A landmark that a track may be of: how far off, as chi-square and in m, and 1-sigma of the expectation in m."""

    landmark: int
    chi_square: float
    distance_m: float
    sigma_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What tracks are: `of` a landmark by track number, `new` ones, and `open` ones that nothing decides yet."""

    of: Mapping[int, int]
    new: tuple[int, ...]
    open: tuple[int, ...]


def chi_square(off: Floats, covariance: Floats) -> float:
    """The squared Mahalanobis length of a difference."""
    return float(off @ np.linalg.solve(covariance, off))


def candidate(landmark: int, seen_m: Floats, expected_m: Floats, *, noise: Floats, expectation: Floats) -> Candidate:
    """A landmark expected at (2,) with covariance `expectation`, seen at (2,) with covariance `noise`."""
    off = seen_m - expected_m
    return Candidate(
        landmark=landmark,
        chi_square=chi_square(off, noise + expectation),
        distance_m=float(np.hypot(*off)),
        sigma_m=float(np.sqrt(np.linalg.eigvalsh(expectation)[-1])),
    )


def answer(candidates: Mapping[int, Sequence[Candidate]]) -> Answer:
    """The answer for all tracks of one keyframe by their candidates, one landmark to one track at most."""
    wanted: dict[int, tuple[int, float]] = {}
    new, left = [], []
    for track, found in sorted(candidates.items()):
        near = sorted((one for one in found if _is_near(one)), key=lambda one: one.chi_square)
        if not near:
            new.append(track)
        elif _is_sure(near):
            wanted[track] = near[0].landmark, near[0].chi_square
        else:
            left.append(track)
    best: dict[int, int] = {}
    for track, (landmark, chi) in wanted.items():
        if landmark not in best or chi < wanted[best[landmark]][1]:
            best[landmark] = track
    of = {track: landmark for landmark, track in best.items()}
    left += [track for track in wanted if track not in of]
    return Answer(of=of, new=tuple(new), open=tuple(left))


def _is_near(one: Candidate) -> bool:
    return one.chi_square <= FAR_GATE or one.distance_m <= SAME_M


def _is_sure(near: Sequence[Candidate]) -> bool:
    first = near[0]
    alone = len(near) == 1 or near[1].chi_square >= first.chi_square + RIVAL_MARGIN
    return first.chi_square <= GATE and first.sigma_m <= TIGHT_M and alone

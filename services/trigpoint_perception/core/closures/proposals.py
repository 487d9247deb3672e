"""Places that constellations take for one another: triangles name them, the evidence of all landmarks decides."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.client.core.constellations import Constellation
from trigpoint.client.core.motion_fit import Expectation, FittedMotion, PositionPrior, fitted_motion
from trigpoint.geodesy.poses import Pose2, transform_points
from trigpoint_perception.core.closures.runs import Run
from trigpoint_perception.core.closures.settings import ClosureSettings, ConstellationSettings
from trigpoint_perception.core.closures.submaps import Submap, landmarks_around
from trigpoint_perception.core.closures.triangles import alike, triangles_of

Floats = NDArray[np.float64]

ANYWHERE_SIGMA_M = 20.0  # of one middle from the other, before any landmark


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """Two sweeps that should be of one place: rows of their runs, the base at the one as seen from the base at the
    other, T_other_one (3,), by `pairs` landmarks; `refusal` where those do not suffice, else empty."""

    run: Run
    row: int
    other: Run
    other_row: int
    T_other_one: Floats
    pairs: int
    refusal: str


def proposals(
    ones: Sequence[Submap], others: Iterable[Sequence[Submap]], settings: ClosureSettings
) -> Iterator[Proposal]:
    """The places among several drives' submaps that each of `ones` may be at, each place once, those with most votes;
    those of one run are far apart on it, the later one first."""
    triangles = triangles_of(ones, settings.triangle)
    rivals: dict[int, list[tuple[int, Submap, Floats]]] = {}
    for drive in others:
        for each in alike(triangles, triangles_of(drive, settings.triangle), settings.triangle):
            one, other = ones[each.one], drive[each.other]
            if not _is_no_return(one, other.run, other.row, settings.triangle.apart_m):
                rivals.setdefault(each.one, []).append((each.votes, other, each.motion))
    for number, named in sorted(rivals.items()):
        named.sort(key=lambda rival: -rival[0])
        yield from _places(ones[number], named, settings)


def _places(one: Submap, rivals: Sequence[tuple[int, Submap, Floats]], settings: ClosureSettings) -> Iterator[Proposal]:
    taken: list[tuple[Run, float]] = []
    for _, other, T_other_one in rivals:
        row, motion = nearest_sweep(other, T_other_one, within_m=settings.submap.span_m)
        if _is_no_return(one, other.run, row, settings.triangle.apart_m):
            continue
        at_m = float(other.run.path_m[row])
        if any(run is other.run and abs(place_m - at_m) < settings.submap.span_m for run, place_m in taken):
            continue
        taken.append((other.run, at_m))
        yield _proposal(one, other.run, row, motion, settings)
        if len(taken) == settings.triangle.tried:
            return


def _is_no_return(one: Submap, run: Run, row: int, apart_m: float) -> bool:
    """Whether a submap's run was not yet far away since a sweep of a run, as it can only have been from its own."""
    return one.run is run and float(run.path_m[one.row] - run.path_m[row]) < apart_m


def nearest_sweep(other: Submap, T_other_one: Floats, *, within_m: float) -> tuple[int, Floats]:
    """The sweep of a submap's run nearest to a place seen from its middle, so much driven from there at most, and the
    place seen from that sweep."""
    run, middle = other.run, Pose2(*other.run.pose[other.row])
    placed = middle.compose(Pose2(*T_other_one))
    away_m = np.hypot(*(run.pose[:, :2] - (placed.x_m, placed.y_m)).T)
    row = int(np.argmin(np.where(np.abs(run.path_m - run.path_m[other.row]) <= within_m, away_m, np.inf)))
    seen = Pose2(*run.pose[row]).inverse().compose(placed)
    return row, np.array([seen.x_m, seen.y_m, seen.heading_rad])


def _proposal(one: Submap, run: Run, row: int, motion: Floats, settings: ClosureSettings) -> Proposal:
    known = landmarks_around(run, row, settings.submap)
    chosen = settings.constellation
    prior = PositionPrior(point_m=np.zeros(2), sigma_m=ANYWHERE_SIGMA_M)
    expected = Expectation(clutter_per_m2=chosen.clutter_per_m2, detected=chosen.detected)
    fitted = fitted_motion(motion, one.landmarks, known, prior, expected) if len(known) else None
    return Proposal(
        run=one.run,
        row=one.row,
        other=run,
        other_row=row,
        T_other_one=motion if fitted is None else fitted.motion,
        pairs=0 if fitted is None else len(fitted.pairs),
        refusal=_refusal(fitted, one.landmarks, known, chosen),
    )


def _refusal(
    fitted: FittedMotion | None, landmarks: Constellation, known: Constellation, settings: ConstellationSettings
) -> str:
    """Why two constellations are not taken for one place; empty where they are."""
    if fitted is None or len(fitted.pairs) < settings.matched_min:
        return "few landmarks fit"
    if len(fitted.pairs) < settings.matched_share_min * _visible(fitted.motion, landmarks, known):
        return "too many landmarks do not fit"
    if fitted.log_evidence < settings.log_evidence_min:
        return "landmarks fit by chance"
    if np.hypot(*fitted.motion[:2]) > settings.offset_max_m:
        return "places too far apart"
    return ""


def _visible(motion: Floats, landmarks: Constellation, known: Constellation) -> int:
    """How many landmarks could have fitted: the fewer of those of either that lie where the other has some."""
    laid_m = transform_points(motion, landmarks.point_m)
    low, high = laid_m.min(axis=0), laid_m.max(axis=0)
    known_low, known_high = known.point_m.min(axis=0), known.point_m.max(axis=0)
    inside = ((laid_m >= known_low) & (laid_m <= known_high)).all(axis=1).sum()
    known_inside = ((known.point_m >= low) & (known.point_m <= high)).all(axis=1).sum()
    return int(min(inside, known_inside))

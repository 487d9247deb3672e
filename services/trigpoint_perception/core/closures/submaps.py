"""The landmarks along a short stretch of a run, as one constellation around its middle."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.client.core.constellations import Constellation
from trigpoint.geodesy.poses import transform_points
from trigpoint_perception.core.closures.runs import Run
from trigpoint_perception.core.closures.settings import SubmapSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Submap:
    """The middle's `row` in its run, and the landmarks in the base's frame there."""

    run: Run
    row: int
    landmarks: Constellation


def submaps_of(runs: Sequence[Run], settings: SubmapSettings) -> list[Submap]:
    """A submap every `step_m` of each run, those with too few landmarks left out."""
    made = [
        Submap(run=run, row=row, landmarks=landmarks_around(run, row, settings))
        for run in runs
        for row in np.unique(np.searchsorted(run.path_m, np.arange(0.0, run.path_m[-1], settings.step_m))).tolist()
    ]
    return [each for each in made if len(each.landmarks) >= settings.landmarks_min]


def landmarks_around(run: Run, row: int, settings: SubmapSettings) -> Constellation:
    """What was seen within half a span of a sweep and often enough, each thing once, in the base's frame there."""
    within = np.abs(run.path_m - run.path_m[row]) <= 0.5 * settings.span_m
    chosen = np.nonzero(within[run.row])[0]
    point_m, covariance_m2 = _seen_from(run, row, chosen, settings)
    _, first, thing, count = np.unique(run.track[chosen], return_index=True, return_inverse=True, return_counts=True)
    information = np.zeros((len(first), 2, 2))
    weighted = np.zeros((len(first), 2))
    weight = np.linalg.inv(covariance_m2)
    np.add.at(information, thing, weight)
    np.add.at(weighted, thing, np.einsum("nij,nj->ni", weight, point_m))
    often = np.nonzero(count >= settings.sights_min)[0]
    mean_m = np.asarray(np.linalg.solve(information[often], weighted[often][..., None])[..., 0], dtype=np.float64)
    kind = np.array([run.kind[chosen[each]] for each in first[often]], dtype=str)
    kept = np.hypot(*mean_m.T) <= settings.reach_m
    kept &= _once(mean_m, kind, count[often], merged_m=settings.merged_m)
    common_m2 = settings.common_sigma_m**2 * np.eye(2)
    return Constellation(
        point_m=mean_m[kept],
        covariance_m2=np.linalg.inv(information[often][kept]) + common_m2,
        kind=tuple(kind[kept].tolist()),
    )


def _seen_from(run: Run, row: int, chosen: Ints, settings: SubmapSettings) -> tuple[Floats, Floats]:
    """Sights' positions (k, 2) in the base's frame at a sweep and covariances (k, 2, 2), with the path's drift."""
    sweep = run.row[chosen]
    turn_rad = run.pose[sweep, 2] - run.pose[row, 2]
    laid_m = transform_points(run.pose[sweep], run.point_m[chosen]) - run.pose[row, :2]
    back = np.array([0.0, 0.0, -run.pose[row, 2]])
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    turn = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    drift_m = settings.drift_share * np.abs(run.path_m[sweep] - run.path_m[row])
    own_m2 = turn @ run.covariance_m2[chosen] @ turn.transpose(0, 2, 1)
    return transform_points(back, laid_m), own_m2 + drift_m[:, None, None] ** 2 * np.eye(2)


def _once(point_m: Floats, kind: NDArray[np.str_], count: Ints, *, merged_m: float) -> NDArray[np.bool_]:
    """Which things (n,) to keep: of those of one kind at one place the one seen most often."""
    near = np.hypot(*(point_m[:, None] - point_m[None]).transpose(2, 0, 1)) < merged_m
    near &= kind[:, None] == kind[None, :]
    rank = np.empty(len(count), dtype=np.int64)
    rank[np.argsort(-count, kind="stable")] = np.arange(len(count))
    return np.asarray(~(near & (rank[None, :] < rank[:, None])).any(axis=1))

"""Estimated landmarks against the true ones: never aligned first, which would hide part of the error."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from trigpoint_evaluation.core.summary import ErrorSummary, summary_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MATCH_LIMIT_M = 3.0  # the least spacing of separate poles; beyond it a landmark is nobody's
CHI2_95_2DOF = 5.991  # 95 % of chi-squared with 2 degrees of freedom: its root in sigmas is a 95 % ellipse's size


@dataclass(frozen=True, slots=True, kw_only=True)
class MappedPoints:
    """Landmarks (n,) in the map frame: positions (n, 2) in m, signatures, covariances (n, 2, 2) in m^2 or None."""

    point_m: Floats
    signature: tuple[str, ...]
    covariance_m2: Floats | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Matches:
    """Pairs (estimated, truth) of landmark numbers (p,); `duplicates` are estimated landmarks within the limit of a
    true one that another is matched to, `unmatched` those near none, `missed` true ones nobody is matched to."""

    estimated: Ints
    truth: Ints
    duplicates: int
    unmatched: int
    missed: int
    limit_m: float


def matched(estimated: MappedPoints, truth: MappedPoints, *, limit_m: float = MATCH_LIMIT_M) -> Matches:
    """Pairs by signature where it is known on both sides, else mutual nearest within `limit_m`."""
    named = _by_signature(estimated, truth)
    pairs = _mutual_nearest(estimated.point_m, truth.point_m, limit_m) if named is None else named
    rest = np.setdiff1d(np.arange(len(estimated.point_m)), pairs[:, 0])
    near = _near_any(estimated.point_m[rest], truth.point_m, limit_m)
    return Matches(
        estimated=pairs[:, 0],
        truth=pairs[:, 1],
        duplicates=int(np.count_nonzero(near)),
        unmatched=int(len(rest) - np.count_nonzero(near)),
        missed=len(truth.point_m) - len(pairs),
        limit_m=limit_m,
    )


def _by_signature(estimated: MappedPoints, truth: MappedPoints) -> Ints | None:
    """Pairs (p, 2) of equal signatures, None where one side has none at all."""
    numbers = {name: index for index, name in enumerate(truth.signature) if name}
    if not numbers or not any(estimated.signature):
        return None
    found = {numbers[name]: index for index, name in reversed(list(enumerate(estimated.signature))) if name in numbers}
    pairs = sorted((index, truth_index) for truth_index, index in found.items())
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _mutual_nearest(point_m: Floats, truth_m: Floats, limit_m: float) -> Ints:
    if len(point_m) == 0 or len(truth_m) == 0:
        return np.zeros((0, 2), dtype=np.int64)
    away_m, nearest_truth = KDTree(truth_m).query(point_m)
    _, nearest_point = KDTree(point_m).query(truth_m)
    numbers = np.arange(len(point_m))
    mutual = (nearest_point[nearest_truth] == numbers) & (away_m <= limit_m)
    return np.column_stack([numbers[mutual], nearest_truth[mutual]]).astype(np.int64)


def _near_any(point_m: Floats, truth_m: Floats, limit_m: float) -> NDArray[np.bool_]:
    if len(point_m) == 0 or len(truth_m) == 0:
        return np.zeros(len(point_m), dtype=bool)
    near: NDArray[np.bool_] = KDTree(truth_m).query(point_m)[0] <= limit_m
    return near


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarkTruthEvaluation:
    """Landmark errors against truth. `error_without_shift_m` has the mean error (`shift_m`: east, north) taken out.

    `nees_per_dof` is the mean normalised squared error of each landmark by its own covariance over 2,
    `coverage_95` the share inside their 95 % ellipses, `joint_nees_per_dof` takes all landmarks' covariance together
    (NaN without one).
    """

    matches: Matches
    error_m: ErrorSummary
    error_without_shift_m: ErrorSummary
    shift_m: tuple[float, float]
    nees_per_dof: float
    coverage_95: float
    joint_nees_per_dof: float


def evaluate_landmarks(
    estimated: MappedPoints, truth: MappedPoints, *, joint_covariance_m2: Floats | None = None
) -> LandmarkTruthEvaluation:
    """The errors of the matched landmarks; joint_covariance_m2 (2n, 2n): x and y of each landmark in turn."""
    matches = matched(estimated, truth)
    error_m = estimated.point_m[matches.estimated] - truth.point_m[matches.truth]
    shift_m = error_m.mean(axis=0) if len(error_m) else np.full(2, np.nan)
    nees = _each_nees(error_m, estimated.covariance_m2, matches.estimated)
    return LandmarkTruthEvaluation(
        matches=matches,
        error_m=summary_of(np.hypot(error_m[:, 0], error_m[:, 1])),
        error_without_shift_m=summary_of(np.hypot(*(error_m - shift_m).T)),
        shift_m=(float(shift_m[0]), float(shift_m[1])),
        nees_per_dof=float(np.mean(nees)) / 2.0 if len(nees) else float("nan"),
        coverage_95=float(np.mean(nees <= CHI2_95_2DOF)) if len(nees) else float("nan"),
        joint_nees_per_dof=joint_nees_per_dof(error_m, joint_covariance_m2, matches.estimated),
    )


def _each_nees(error_m: Floats, covariance_m2: Floats | None, chosen: Ints) -> Floats:
    if covariance_m2 is None or len(error_m) == 0:
        return np.zeros(0)
    solved = np.linalg.solve(covariance_m2[chosen], error_m[..., None])[..., 0]
    squared: Floats = np.einsum("na,na->n", error_m, solved)
    return squared


def joint_nees_per_dof(error_m: Floats, joint_covariance_m2: Floats | None, chosen: Ints) -> float:
    """e' C^-1 e over its 2n degrees of freedom, for errors (n, 2) of the `chosen` (n,) landmarks of C; NaN without."""
    if joint_covariance_m2 is None or len(error_m) == 0:
        return float("nan")
    rows = np.column_stack([2 * chosen, 2 * chosen + 1]).reshape(-1)
    error = error_m.reshape(-1)
    return float(error @ np.linalg.solve(joint_covariance_m2[np.ix_(rows, rows)], error)) / len(error)

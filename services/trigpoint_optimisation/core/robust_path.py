"""A path through odometry that is unsure within metres and fixes of which many are wrong: robust least squares with
everything of a drive in one banded system, so fast that it can run to its end.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import csr_matrix

from trigpoint.geodesy.poses import wrap_angles_rad
from trigpoint_optimisation.core.odometry import Motions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STATES = 5  # of a keyframe: x, y, heading, and the fixes' slow error in x and y
CALIBRATIONS = 4  # speed scale, turn scale, delay in s, turn bias
BAND = 2 * STATES - 1  # a keyframe's states meet the next one's
MAX_ITERATIONS = 60
MAX_HALVINGS = 10
STILL = 0.02  # m or rad: no state moves further in a step that is the last
RIDGE = 1e-9  # on the diagonal: a keyframe that nothing sees stays where it is


@dataclass(frozen=True, slots=True, kw_only=True)
class HungFixes:
    """Fixes on keyframes: fix_m (f, 2) in the map, keyframe (f,), antenna_m (f, 2) in the keyframe's frame; white
    error `sigma_m`, beyond `cauchy_m` ever less counted, and slow error of `slow_m` over `slow_s`, Gauss-Markov."""

    fix_m: Floats
    keyframe: Ints
    antenna_m: Floats
    sigma_m: float
    cauchy_m: float
    slow_m: float
    slow_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationPrior:
    """What is known of a calibration (4,) beforehand: root_information (4, 4) times its difference to mean (4,) has
    unit covariance."""

    mean: Floats
    root_information: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustPath:
    """pose (n, 3) in the map, slow_m (n, 2) error of the fixes, calibration (4,)."""

    pose: Floats
    slow_m: Floats
    calibration: Floats


@dataclass(frozen=True, slots=True)
class _Rows:
    """Whitened rows of the linear system: columns (r, c), values (r, c), residual (r,)."""

    column: Ints
    value: Floats
    residual: Floats


MotionsAt = Callable[[Floats], Motions]


def robust_path(motions_at: MotionsAt, start: RobustPath, fixes: HungFixes, prior: CalibrationPrior) -> RobustPath:
    """The path near `start` that odometry, integrated anew at each calibration (4,), and fixes agree on."""
    path = start
    for _ in range(MAX_ITERATIONS):
        weight = _weights(path, fixes)
        motions = motions_at(path.calibration)
        rows = _rows(path, motions, fixes, prior, weight)
        step = _step(rows, len(path.pose))
        cost, factor = _cost(rows), 1.0
        moved = _moved(path, step)
        for _ in range(MAX_HALVINGS):
            if _cost(_rows(moved, motions_at(moved.calibration), fixes, prior, weight)) <= cost:
                break
            factor *= 0.5
            moved = _moved(path, factor * step)
        path = moved
        if factor * float(np.abs(step).max()) < STILL:
            break
    return path


def _turned(heading: Floats, point: Floats) -> Floats:
    c, s = np.cos(heading), np.sin(heading)
    return np.column_stack([c * point[:, 0] - s * point[:, 1], s * point[:, 0] + c * point[:, 1]])


def _fix_residuals(path: RobustPath, fixes: HungFixes) -> tuple[Floats, Floats]:
    """Antenna plus slow error minus fix (f, 2), and the antenna's arm (f, 2) in the map."""
    pose = path.pose[fixes.keyframe]
    arm = _turned(pose[:, 2], fixes.antenna_m)
    return pose[:, :2] + arm + path.slow_m[fixes.keyframe] - fixes.fix_m, arm


def _weights(path: RobustPath, fixes: HungFixes) -> Floats:
    square_m2 = (_fix_residuals(path, fixes)[0] ** 2).sum(axis=1)
    weights: Floats = 1.0 / (1.0 + square_m2 / fixes.cauchy_m**2)
    return weights


def _rows(
    path: RobustPath, motions: Motions, fixes: HungFixes, prior: CalibrationPrior, weight: Floats
) -> tuple[_Rows, ...]:
    calibration = STATES * len(path.pose) + np.arange(CALIBRATIONS)
    off = prior.root_information @ (path.calibration - prior.mean)
    held = _Rows(np.tile(calibration, (CALIBRATIONS, 1)), prior.root_information, off)
    return _motion_rows(path, motions), *_fix_rows(path, fixes, weight), *_slow_rows(path, motions, fixes), held


def _motion_rows(path: RobustPath, motions: Motions) -> _Rows:
    here, there = path.pose[:-1], path.pose[1:]
    count = len(here)
    way = _turned(-here[:, 2], there[:, :2] - here[:, :2])
    c, s = np.cos(here[:, 2]), np.sin(here[:, 2])
    zero, one = np.zeros(count), np.ones(count)
    residual = np.column_stack([way, there[:, 2] - here[:, 2]]) - motions.delta
    residual[:, 2] = wrap_angles_rad(residual[:, 2])
    by_pose = np.stack(
        [
            np.column_stack([-c, -s, way[:, 1], c, s, zero]),
            np.column_stack([s, -c, -way[:, 0], -s, c, zero]),
            np.column_stack([zero, zero, -one, zero, zero, one]),
        ],
        axis=1,
    )
    white = np.linalg.inv(np.linalg.cholesky(motions.covariance))
    value = white @ np.concatenate([by_pose, -motions.derivative], axis=2)
    own = STATES * np.arange(count)[:, None] + np.array([0, 1, 2, STATES, STATES + 1, STATES + 2])
    shared = np.tile(STATES * (count + 1) + np.arange(CALIBRATIONS), (count, 1))
    column = np.repeat(np.column_stack([own, shared]), 3, axis=0)
    return _Rows(column, value.reshape(3 * count, -1), np.einsum("nij,nj->ni", white, residual).ravel())


def _fix_rows(path: RobustPath, fixes: HungFixes, weight: Floats) -> list[_Rows]:
    residual, arm = _fix_residuals(path, fixes)
    root = np.sqrt(weight) / fixes.sigma_m
    first = STATES * fixes.keyframe
    by_heading = (-arm[:, 1], arm[:, 0])
    return [
        _Rows(
            np.column_stack([first + axis, first + 2, first + 3 + axis]),
            np.column_stack([root, root * by_heading[axis], root]),
            root * residual[:, axis],
        )
        for axis in (0, 1)
    ]


def _slow_rows(path: RobustPath, motions: Motions, fixes: HungFixes) -> list[_Rows]:
    decay = np.exp(-np.diff(motions.stamp_ns) * 1e-9 / fixes.slow_s)
    root = 1.0 / (fixes.slow_m * np.sqrt(1.0 - decay**2))
    knot = STATES * np.arange(len(decay)) + 3
    rows = []
    for axis in (0, 1):
        slow = path.slow_m[:, axis]
        column = np.column_stack([knot + axis, knot + STATES + axis])
        rows.append(_Rows(column, np.column_stack([-decay * root, root]), root * (slow[1:] - decay * slow[:-1])))
        rows.append(_Rows(np.array([[3 + axis]]), np.array([[1.0 / fixes.slow_m]]), slow[:1] / fixes.slow_m))
    return rows


def _cost(rows: tuple[_Rows, ...]) -> float:
    return float(sum(each.residual @ each.residual for each in rows))


def _step(rows: tuple[_Rows, ...], count: int) -> Floats:
    """The Gauss-Newton step (5 n + 4,): the keyframes eliminated as a band, the calibration by its complement."""
    own, lengths = STATES * count, [len(each.residual) for each in rows]
    start = np.concatenate([[0], np.cumsum(lengths)])
    row = [np.repeat(np.arange(a, a + len(r.residual)), r.value.shape[1]) for a, r in zip(start, rows, strict=False)]
    place = np.concatenate(row), np.concatenate([each.column.ravel() for each in rows])
    values = np.concatenate([each.value.ravel() for each in rows])
    jacobian = csr_matrix((values, place), shape=(start[-1], own + CALIBRATIONS))
    normal = (jacobian.T @ jacobian).tocsr()
    gradient = jacobian.T @ np.concatenate([each.residual for each in rows])
    inner = normal[:own, :own].tocoo()
    lower = inner.row >= inner.col
    band = np.zeros((BAND + 1, own))
    band[inner.row[lower] - inner.col[lower], inner.col[lower]] = inner.data[lower]
    band[0] += RIDGE
    border = normal[:own, own:].toarray()
    solution = cho_solve_banded((cholesky_banded(band, lower=True), True), np.column_stack([border, gradient[:own]]))
    complement = normal[own:, own:].toarray() - border.T @ solution[:, :-1]
    calibration = -np.linalg.solve(complement, gradient[own:] - border.T @ solution[:, -1])
    return np.concatenate([-solution[:, -1] - solution[:, :-1] @ calibration, calibration])


def _moved(path: RobustPath, step: Floats) -> RobustPath:
    own = step[:-CALIBRATIONS].reshape(-1, STATES)
    return RobustPath(
        pose=path.pose + own[:, :3],
        slow_m=path.slow_m + own[:, 3:],
        calibration=path.calibration + step[-CALIBRATIONS:],
    )

"""Where a dead-reckoned path lies in the map: one rigid motion for all of it, or a path bent to its fixes."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from trigpoint.errors import AlignmentRefused
from trigpoint.geodesy.poses import Pose2, transform_points, wrap_angles_rad

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

MIN_EIGENVALUE_RATIO = 1e-3  # of the path's scatter: a 500 m straight with 15 m of sway is at the limit
MIN_EXTENT_SIGMAS = 3.0  # the path's larger RMS extent, in sigmas of a fix
MIN_FIXES = 3
ROBUST_ROUNDS = 20
CHORD_M = (12.0, 60.0)  # path length between two fixes whose direction is compared with the path's
HEADING_WINDOW_M = 40.0  # path length over which heading corrections are averaged
RUN_BREAK_M = 8.0  # a larger jump of the correction between neighbouring fixes starts a new run
RUN_DRIFT_M = 20.0  # corrections of neighbouring runs may differ by this much, and
RUN_DRIFT_FRACTION = 0.10  # by this part of the path between them
CORRECTION_M_PER_SQRT_M = 0.15  # random walk of the position correction along the path, m / sqrt(m)


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidAlignment:
    """The SE(2) that takes path coordinates into the map, with how well the data fix it."""

    T_map_path: Pose2
    heading_sigma_rad: float
    eigenvalue_ratio: float
    residual_m: Floats


def weighted_rigid(point_path_m: Floats, point_map_m: Floats, weight: Floats) -> Pose2:
    """The rigid motion of points (n, 2) onto points (n, 2), least squares with weights (n,)."""
    total = weight.sum()
    centre_path = weight @ point_path_m / total
    centre_map = weight @ point_map_m / total
    a, b = point_path_m - centre_path, point_map_m - centre_map
    cross = float(weight @ (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
    heading = math.atan2(cross, float(weight @ (a * b).sum(axis=1)))
    turned = transform_points(np.array([0.0, 0.0, heading]), centre_path)
    return Pose2(float(centre_map[0] - turned[0]), float(centre_map[1] - turned[1]), heading)


def rigid_alignment(point_path_m: Floats, point_map_m: Floats, *, sigma_m: float) -> RigidAlignment:
    """The rigid motion that brings points (n, 2) of a path onto time-matched points (n, 2) in the map, least
    squares with Cauchy weights after a plain solve (Umeyama 1991 without scale; Holland and Welsch 1977).

    Raises AlignmentRefused when fewer than three points match, or the path is nearly stationary or straight:
    the ratio of its scatter's eigenvalues is the measure.
    """
    if len(point_path_m) < MIN_FIXES:
        raise AlignmentRefused(f"{len(point_path_m)} fixes match the path: at least {MIN_FIXES} are needed")
    scatter = np.linalg.eigvalsh(np.cov(point_path_m.T))
    extent_m = math.sqrt(max(scatter[1], 0.0))
    if extent_m < MIN_EXTENT_SIGMAS * sigma_m:
        raise AlignmentRefused(
            f"nearly stationary: the path's RMS extent is {extent_m:.2f} m, "
            f"at least {MIN_EXTENT_SIGMAS * sigma_m:.2f} m is needed"
        )
    ratio = float(max(scatter[0], 0.0) / scatter[1])
    if ratio < MIN_EIGENVALUE_RATIO:
        raise AlignmentRefused(
            f"nearly straight: the path's eigenvalue ratio is {ratio:.2e}, "
            f"at least {MIN_EIGENVALUE_RATIO:.0e} is needed"
        )
    return _robust_rigid(point_path_m, point_map_m, sigma_m=sigma_m, ratio=ratio)


def _robust_rigid(point_path_m: Floats, point_map_m: Floats, *, sigma_m: float, ratio: float) -> RigidAlignment:
    weight = np.ones(len(point_path_m))
    residual = np.zeros_like(point_path_m)
    for _ in range(ROBUST_ROUNDS):
        T_map_path = weighted_rigid(point_path_m, point_map_m, weight)
        as_array = np.array([T_map_path.x_m, T_map_path.y_m, T_map_path.heading_rad])
        residual = point_map_m - transform_points(as_array, point_path_m)
        scale = max(sigma_m, 1.4826 * float(np.median(np.linalg.norm(residual, axis=1))))
        weight = 1.0 / (1.0 + (residual**2).sum(axis=1) / scale**2)
    spread = float(weight @ ((point_path_m - weight @ point_path_m / weight.sum()) ** 2).sum(axis=1))
    return RigidAlignment(
        T_map_path=T_map_path,
        heading_sigma_rad=sigma_m / math.sqrt(max(spread, 1e-12)),
        eigenvalue_ratio=ratio,
        residual_m=residual,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BentAlignment:
    """A path bent to its fixes. pose (n, 3): the fixes' base poses in the map; consistent (n,) which fixes agree
    with one another and the path."""

    heading_correction_rad: Floats
    pose: Floats
    consistent: Bools


def _heading_corrections(antenna_m: Floats, fix_m: Floats, path_m: Floats, sigma_m: float) -> Floats:
    """Heading of the map path minus the dead-reckoned one at each fix (n,), unwrapped, from chords between fixes
    whose length agrees with the path's. Raises AlignmentRefused when no chord does."""
    n = len(path_m)
    chords = []
    for reach_m in np.linspace(*CHORD_M, 5):
        later = np.searchsorted(path_m, path_m + reach_m)
        i = np.nonzero(later < n)[0]
        chords.append(np.column_stack([i, later[i]]))
    i, j = np.unique(np.concatenate(chords), axis=0).T
    a, z = antenna_m[j] - antenna_m[i], fix_m[j] - fix_m[i]
    length_a, length_z = np.hypot(*a.T), np.hypot(*z.T)
    good = (length_a > 0.5 * CHORD_M[0]) & (np.abs(length_a - length_z) < 3.0 * sigma_m + 0.05 * length_a)
    good &= path_m[j] - path_m[i] < 2.0 * CHORD_M[1]
    if not good.any():
        raise AlignmentRefused(f"no two fixes {CHORD_M[0]:g} to {CHORD_M[1]:g} m apart agree with the path's length")
    a, z, middle = a[good], z[good], 0.5 * (path_m[i] + path_m[j])[good]
    turn = (z[:, 0] + 1j * z[:, 1]) * (a[:, 0] - 1j * a[:, 1])
    return _smoothed_angles(turn / np.abs(turn) * np.hypot(*a.T) ** 2, middle, path_m)


def _smoothed_angles(phasor: NDArray[np.complex128], at_m: Floats, path_m: Floats) -> Floats:
    """Angles (n,) at `path_m` of phasors (k,) at `at_m`, averaged over a window and interpolated, unwrapped."""
    order = np.argsort(at_m)
    total = np.concatenate([[0.0], np.cumsum(phasor[order])])
    low = np.searchsorted(at_m[order], path_m - 0.5 * HEADING_WINDOW_M)
    high = np.searchsorted(at_m[order], path_m + 0.5 * HEADING_WINDOW_M)
    mean = total[high] - total[low]
    known = high > low
    if not known.any():
        known = np.zeros(len(path_m), dtype=bool)
        known[0], mean = True, np.full(len(path_m), total[-1])
    angle: Floats = np.interp(path_m, path_m[known], np.unwrap(np.angle(mean[known])))
    return angle


def turned_path(pose: Floats, correction_rad: Floats) -> Floats:
    """Poses (n, 3) whose steps are turned by the correction (n,)."""
    step = np.diff(pose[:, :2], axis=0)
    middle = 0.5 * (correction_rad[1:] + correction_rad[:-1])
    c, s = np.cos(middle), np.sin(middle)
    turned = np.column_stack([c * step[:, 0] - s * step[:, 1], s * step[:, 0] + c * step[:, 1]])
    xy = np.concatenate([np.zeros((1, 2)), np.cumsum(turned, axis=0)])
    return np.column_stack([xy, pose[:, 2] + correction_rad])


def consistent_fixes(correction_m: Floats, path_m: Floats) -> Bools:
    """Which fixes (n,) belong to the longest chain of runs that the path can join.

    A run is a stretch of fixes whose correction (fix minus path, (n, 2)) does not jump; runs may follow one
    another when their corrections differ by no more than the path can drift between them.
    """
    jump = np.hypot(*np.diff(correction_m, axis=0).T) > RUN_BREAK_M
    start = np.concatenate([[0], np.nonzero(jump)[0] + 1])
    end = np.concatenate([start[1:], [len(path_m)]])
    best, previous = np.zeros(len(start)), np.full(len(start), -1)
    for k in range(len(start)):
        gap_m = path_m[start[k]] - path_m[end[:k] - 1]
        apart_m = np.hypot(*(correction_m[start[k]] - correction_m[end[:k] - 1]).T)
        joinable = apart_m < RUN_DRIFT_M + RUN_DRIFT_FRACTION * gap_m
        if joinable.any():
            previous[k] = int(np.argmax(np.where(joinable, best[:k], -1.0)))
        best[k] = (end[k] - start[k]) + (best[previous[k]] if previous[k] >= 0 else 0.0)
    keep = np.zeros(len(path_m), dtype=bool)
    k = int(np.argmax(best))
    while k >= 0:
        keep[start[k] : end[k]] = True
        k = int(previous[k])
    return keep


def _smooth_correction(correction_m: Floats, weight: Floats, path_m: Floats) -> Floats:
    """Position corrections (n, 2) as a random walk along the path, least squares against the weighted ones."""
    step = 1.0 / (CORRECTION_M_PER_SQRT_M**2 * np.maximum(np.diff(path_m), 0.1))
    band = np.zeros((2, len(path_m)))
    band[1] = weight + 1e-9
    band[1, :-1] += step
    band[1, 1:] += step
    band[0, 1:] = -step
    smooth: Floats = solveh_banded(band, correction_m * (weight + 1e-9)[:, None])
    return smooth


def bent_alignment(
    path_pose: Floats, antenna_base_m: Floats, fix_m: Floats, *, path_m: Floats, sigma_m: float
) -> BentAlignment:
    """The path of a drive brought into the map by its fixes, heading first, then position.

    path_pose (n, 3): dead-reckoned base poses at the fixes, fix_m (n, 2) in the map, path_m (n,) path length at
    each. Directions between fixes whose distance agrees with the path's give the heading along it; then the
    longest self-consistent chain of fixes gives the position. Neither needs a first guess.
    Raises AlignmentRefused when fewer than three fixes, or no chord between them, agree with the path.
    """
    if len(fix_m) < MIN_FIXES:
        raise AlignmentRefused(f"{len(fix_m)} fixes match the path: at least {MIN_FIXES} are needed")
    antenna = transform_points(path_pose, antenna_base_m)
    turn = _heading_corrections(antenna, fix_m, path_m, sigma_m)
    pose = turned_path(path_pose, turn)
    correction = fix_m - transform_points(pose, antenna_base_m)
    consistent = consistent_fixes(correction, path_m)
    weight = consistent / sigma_m**2
    smooth = _smooth_correction(correction, weight, path_m)
    for _ in range(ROBUST_ROUNDS):
        residual = ((correction - smooth) ** 2).sum(axis=1) / sigma_m**2
        smooth = _smooth_correction(correction, weight / (1.0 + residual), path_m)
    pose[:, :2] += smooth
    pose[:, 2] = wrap_angles_rad(pose[:, 2])
    return BentAlignment(heading_correction_rad=turn, pose=pose, consistent=consistent)

"""Keyframe poses from odometry and fixes by one linear solve, without any first guess of heading or position."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from trigpoint_optimisation.core.odometry import Motions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Complexes = NDArray[np.complex128]

ROUNDS = 15  # of reweighting after the plain solve
BAND = 4  # a keyframe's position and rotation meet the next one's: four neighbouring unknowns


def chordal_poses(
    motions: Motions, fix_m: Floats, arm_m: Floats, keyframe: Ints, *, sigma_m: float, cauchy_m: float | None
) -> Floats:
    """Keyframe poses (n, 3) in the map: x, y in m, heading in rad.

    fix_m (f, 2) in the map, arm_m (f, 2) the antenna in its keyframe's frame, keyframe (f,). Position and rotation of
    each keyframe are complex unknowns, the rotation's length left free: then odometry and fixes are linear in them
    (chordal relaxation; Carlone et al. 2015), first plain, then, unless it is None, with Cauchy weights of scale
    `cauchy_m`.
    """
    weight = np.ones(len(fix_m))
    solution = np.zeros(2 * len(motions.stamp_ns), dtype=np.complex128)
    fix, arm = fix_m[:, 0] + 1j * fix_m[:, 1], arm_m[:, 0] + 1j * arm_m[:, 1]
    base = _motion_band(motions)
    for _ in range(1 + ROUNDS):
        band, right = base.copy(), np.zeros(len(solution), dtype=np.complex128)
        _add_fixes(band, right, fix, arm, keyframe, weight / sigma_m**2)
        solution = solveh_banded(band, right, overwrite_ab=True, overwrite_b=True)
        if cauchy_m is None:
            break
        rotation = solution[1::2][keyframe]
        turned = arm * rotation / np.maximum(np.abs(rotation), 1e-12)
        weight = 1.0 / (1.0 + (np.abs(fix - solution[0::2][keyframe] - turned) / cauchy_m) ** 2)
    position, rotation = solution[0::2], solution[1::2]
    return np.column_stack([position.real, position.imag, np.angle(rotation)])


def _add(band: Complexes, row: Ints, column: Ints, value: NDArray[np.complexfloating[Any, Any]]) -> None:
    """Adds to entries on or above the diagonal, in the upper form of solveh_banded."""
    np.add.at(band, (BAND - 1 + row - column, column), value)


def _motion_band(motions: Motions) -> Complexes:
    """The normal matrix of odometry in banded form: t' = t + R u and R' = R r for neighbouring keyframes."""
    count = len(motions.stamp_ns)
    band = np.zeros((BAND, 2 * count), dtype=np.complex128)
    t = 2 * np.arange(count - 1)
    step = motions.delta[:, 0] + 1j * motions.delta[:, 1]
    turn = np.exp(1j * motions.delta[:, 2])
    by_step = 1.0 / np.maximum(0.5 * (motions.covariance[:, 0, 0] + motions.covariance[:, 1, 1]), 1e-8) + 0j
    by_turn = 1.0 / np.maximum(motions.covariance[:, 2, 2], 1e-10) + 0j
    # |t' - t - R u|^2 and |R' - R r|^2; a row conjugates the unknown it belongs to
    _add(band, t, t, by_step)
    _add(band, t + 2, t + 2, by_step)
    _add(band, t, t + 2, -by_step)
    _add(band, t + 1, t + 1, by_step * np.abs(step) ** 2 + by_turn)
    _add(band, t, t + 1, by_step * step)
    _add(band, t + 1, t + 2, -by_step * np.conj(step))
    _add(band, t + 3, t + 3, by_turn)
    _add(band, t + 1, t + 3, -by_turn * np.conj(turn))
    band[-1] += 1e-9
    return band


def _add_fixes(
    band: Complexes, right: Complexes, fix: Complexes, arm: Complexes, keyframe: Ints, weight: Floats
) -> None:
    """Adds |fix - t - R arm|^2 with weights (f,)."""
    t = 2 * keyframe
    _add(band, t, t, weight + 0j)
    _add(band, t + 1, t + 1, weight * np.abs(arm) ** 2 + 0j)
    _add(band, t, t + 1, weight * arm)
    np.add.at(right, t, weight * fix)
    np.add.at(right, t + 1, weight * np.conj(arm) * fix)

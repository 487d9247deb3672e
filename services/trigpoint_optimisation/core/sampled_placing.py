"""Poses, calibration and trustworthy fixes of a drive whose wheels were only sampled."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve

from trigpoint.geodesy.poses import transform_points, wrap_angles_rad
from trigpoint_optimisation.core.graph import scale_sigmas, turn_sigmas
from trigpoint_optimisation.core.odometry import Motions, OdometryCalibration, keyframe_motions
from trigpoint_optimisation.core.preparation import PreparedDrive, odometry_noise
from trigpoint_optimisation.core.robust_path import CalibrationPrior, HungFixes, RobustPath, robust_path
from trigpoint_optimisation.settings import SAMPLED_SELECTION_EDGES, SolveSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Values = Floats | NDArray[np.complex128] | NDArray[np.complexfloating]
Entry = tuple[Ints, Values]


def sampled_path(prepared: PreparedDrive, usable: Bools, settings: SolveSettings, *, point_scale: float) -> RobustPath:
    """The robust path of a drive by its usable fixes (f,), from a linear start."""
    fixes = _hung_fixes(prepared, usable, point_scale)

    def motions_at(calibration: Floats) -> Motions:
        return keyframe_motions(
            prepared.drive,
            _calibration(prepared, calibration),
            prepared.stamp_ns,
            noise=odometry_noise(prepared.source, settings.odometry),
            max_gap_s=settings.odometry.max_gap_s,
        )

    sigma = np.append(
        scale_sigmas(prepared, settings.calibration), turn_sigmas(prepared.source, settings.calibration)[1]
    )
    prior = CalibrationPrior(mean=np.array([point_scale, 1.0, 0.0, 0.0]), root_information=np.diag(1.0 / sigma))
    return robust_path(motions_at, linear_start(motions_at(prior.mean), fixes, prior), fixes, prior)


def _calibration(prepared: PreparedDrive, calibration: Floats) -> OdometryCalibration:
    speed, turn, delay_s, bias = calibration.tolist()
    return replace(
        prepared.calibration,
        speed_scale=speed,
        turn_scale=turn,
        delay_s=delay_s,
        turn_bias=np.full(len(prepared.calibration.turn_bias), bias),
    )


def _hung_fixes(prepared: PreparedDrive, usable: Bools, point_scale: float) -> HungFixes:
    edges = SAMPLED_SELECTION_EDGES
    return HungFixes(
        fix_m=prepared.fix_m[usable],
        keyframe=prepared.fix_keyframe[usable],
        antenna_m=transform_points(prepared.fix_offset[usable], prepared.nominal_antenna_m(point_scale)),
        sigma_m=edges.sigma_m,
        cauchy_m=edges.kernel.sigmas * edges.sigma_m,
        slow_m=edges.bias_sigma_m,
        slow_s=edges.bias_time_s,
    )


def linear_start(motions: Motions, fixes: HungFixes, prior: CalibrationPrior) -> RobustPath:
    """The chordal relaxation with the fixes' slow error beside it: per keyframe a complex position, a rotation of any
    length, and the slow error; one linear solve without any first guess."""
    count = len(motions.stamp_ns)
    position, rotation, slow = (3 * np.arange(count) + place for place in range(3))
    centre = fixes.fix_m.mean(axis=0)
    fix = (fixes.fix_m - centre) @ np.array([1.0, 1.0j])
    step, turn = motions.delta[:, 0] + 1j * motions.delta[:, 1], np.exp(1j * motions.delta[:, 2])
    by_step = np.sqrt(2.0 / (motions.covariance[:, 0, 0] + motions.covariance[:, 1, 1]))
    by_turn = 1.0 / np.sqrt(motions.covariance[:, 2, 2])
    decay = np.exp(-np.diff(motions.stamp_ns) * 1e-9 / fixes.slow_s)
    by_slow = 1.0 / (fixes.slow_m * np.sqrt(1.0 - decay**2))
    by_fix = np.full(len(fix), 1.0 / fixes.sigma_m)
    seen, antenna = fixes.keyframe, fixes.antenna_m @ np.array([1.0, 1.0j])
    blocks: list[tuple[list[Entry], Values]] = [
        ([(position[1:], by_step), (position[:-1], -by_step), (rotation[:-1], -step * by_step)], np.zeros(count - 1)),
        ([(rotation[1:], by_turn), (rotation[:-1], -turn * by_turn)], np.zeros(count - 1)),
        ([(slow[1:], by_slow), (slow[:-1], -decay * by_slow)], np.zeros(count - 1)),
        ([(position[seen], by_fix), (rotation[seen], antenna * by_fix), (slow[seen], by_fix)], fix * by_fix),
        ([(slow[:1], np.array([1.0 / fixes.slow_m]))], np.zeros(1)),
    ]
    solution = _least_squares(blocks, 3 * count)
    place, error = solution[position], solution[slow]
    return RobustPath(
        pose=np.column_stack([place.real + centre[0], place.imag + centre[1], np.angle(solution[rotation])]),
        slow_m=np.column_stack([error.real, error.imag]),
        calibration=prior.mean,
    )


def _least_squares(blocks: list[tuple[list[Entry], Values]], count: int) -> NDArray[np.complex128]:
    rows, columns, values, start = [], [], [], 0
    for entries, right in blocks:
        for column, value in entries:
            rows.append(start + np.arange(len(right)))
            columns.append(column)
            values.append(value + 0j)
        start += len(right)
    place = np.concatenate(rows), np.concatenate(columns)
    matrix = csr_matrix((np.concatenate(values), place), shape=(start, count))
    adjoint = matrix.conj().T
    solution: NDArray[np.complex128] = spsolve(
        (adjoint @ matrix).tocsc(), adjoint @ np.concatenate([right for _, right in blocks])
    )
    return solution


def wrapped_pose(path: RobustPath) -> Floats:
    """The path's poses (n, 3) with headings within one turn."""
    return np.column_stack([path.pose[:, :2], wrap_angles_rad(path.pose[:, 2])])

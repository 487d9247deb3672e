"""The robust path of a drive whose wheels were sampled once a second, with a receiver that wanders off."""

import numpy as np
import pytest
from numpy.typing import NDArray

from trigpoint_optimisation.core.odometry import DeadReckonedPath, Motions, relative_poses
from trigpoint_optimisation.core.robust_path import CalibrationPrior, HungFixes, RobustPath, robust_path
from trigpoint_optimisation.core.sampled_placing import linear_start

Floats = NDArray[np.float64]

COUNT = 400
SPEED_MPS = 1.3
WANDERING = slice(150, 210)  # a minute in which the receiver is 40 m off
PRIOR = CalibrationPrior(mean=np.array([1.0, 1.0, 0.0, 0.0]), root_information=np.diag([10.0, 20.0, 3.0, 30.0]))


def driven_path() -> Floats:
    """Poses (n, 3), one a second, round blocks of houses; begins at a heading nobody knows."""
    heading = 2.0 + np.cumsum(np.where(np.arange(COUNT) % 60 < 4, 0.4, 0.0))
    way = SPEED_MPS * np.column_stack([np.cos(heading), np.sin(heading)])
    return np.column_stack([np.vstack([[1000.0, -500.0], [1000.0, -500.0] + np.cumsum(way, axis=0)[:-1]]), heading])


def motions_of(pose: Floats, calibration: Floats) -> Motions:
    """Motions of the poses, as wheels that read a tenth too much speed tell them."""
    delta = relative_poses(pose[:-1], pose[1:])
    derivative = np.zeros((COUNT - 1, 3, 4))
    derivative[:, :2, 0] = delta[:, :2] * 1.1
    delta[:, :2] *= 1.1 * calibration[0]
    stamp_ns = np.arange(COUNT, dtype=np.int64) * 1_000_000_000
    zero = np.zeros(COUNT)
    path = DeadReckonedPath(
        stamp_ns=stamp_ns, pose=pose, distance_m=zero, turned_rad=zero, sampling_m2=zero, sampling_rad2=zero
    )
    covariance = np.tile(np.diag([0.1**2, 0.04**2, 0.08**2]), (COUNT - 1, 1, 1))
    index = np.zeros(COUNT - 1, dtype=np.int64)
    return Motions(
        stamp_ns=stamp_ns, delta=delta, derivative=derivative, covariance=covariance, bias_index=index, path=path
    )


def fixes_of(pose: Floats) -> HungFixes:
    """A fix a second with 2 m of noise, and a minute of them 40 m to the east."""
    fix_m = pose[:, :2] + np.random.default_rng(3).normal(0.0, 2.0, (COUNT, 2))
    fix_m[WANDERING, 0] += 40.0
    return HungFixes(
        fix_m=fix_m,
        keyframe=np.arange(COUNT, dtype=np.int64),
        antenna_m=np.zeros((COUNT, 2)),
        sigma_m=15.0,
        cauchy_m=4.5,
        slow_m=3.0,
        slow_s=60.0,
    )


@pytest.fixture(scope="module")
def found() -> tuple[Floats, RobustPath, RobustPath]:
    """The truth, the linear start and the robust path."""
    pose = driven_path()
    fixes = fixes_of(pose)
    start = linear_start(motions_of(pose, PRIOR.mean), fixes, PRIOR)
    return pose, start, robust_path(lambda calibration: motions_of(pose, calibration), start, fixes, PRIOR)


def test_the_linear_start_needs_no_heading(found: tuple[Floats, RobustPath, RobustPath]) -> None:
    pose, start, _ = found
    away = np.abs(np.angle(np.exp(1j * (start.pose[:, 2] - pose[:, 2]))))
    assert np.median(away) < 0.3  # rad: from there the path's own steps lead to the right minimum


def test_a_minute_of_wandering_does_not_bend_the_path(found: tuple[Floats, RobustPath, RobustPath]) -> None:
    pose, start, path = found
    error_m = np.hypot(*(path.pose - pose)[WANDERING, :2].T)
    assert np.hypot(*(start.pose - pose)[WANDERING, :2].T).max() > 10.0  # m: the plain solve follows
    assert error_m.max() < 6.0  # m: heading strays by 0.08 rad per sqrt(s) for half a minute of 1.3 m/s


def test_the_speed_scale_is_found(found: tuple[Floats, RobustPath, RobustPath]) -> None:
    assert abs(found[2].calibration[0] - 1.0 / 1.1) < 0.02  # 2 m of noise on blocks of 78 m

"""Relative poses between two times of a drive, or of two drives, hung on keyframes: lidar odometry, closed loops."""

from dataclasses import dataclass, replace

import gtsam
import numpy as np
from numpy.typing import NDArray

from trigpoint.events.drives import MotionSeries
from trigpoint_optimisation.core.graph import with_kernel
from trigpoint_optimisation.core.odometry import relative_poses
from trigpoint_optimisation.core.preparation import PreparedDrive
from trigpoint_optimisation.core.state import pose_key
from trigpoint_optimisation.core.trajectory import composed
from trigpoint_optimisation.settings import Kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class RelativePoses:
    """Measured poses (r,) of keyframe `to_keyframe` of `to_drive` in the frame of `from_keyframe` of `from_drive`:
    T_from_to (r, 3): x, y in map metres, heading in rad; covariance (r, 3, 3) of an error along and across the later
    keyframe's own axes and in heading, as gtsam takes it."""

    from_drive: Ints
    from_keyframe: Ints
    to_drive: Ints
    to_keyframe: Ints
    T_from_to: Floats
    covariance: Floats


def hung_motions(
    start: PreparedDrive, end: PreparedDrive, motions: MotionSeries, *, point_scale: float
) -> RelativePoses:
    """Where `end` was at `stamp_ns` as seen from `start` at `from_stamp_ns`, told of the keyframes before both.

    The two may be one drive. Motions from or to a time that its drive's wheels do not cover are left out.
    """
    covered = _covers(start, motions.from_stamp_ns) & _covers(end, motions.stamp_ns)
    from_keyframe, from_offset = start.hung(motions.from_stamp_ns[covered])
    to_keyframe, to_offset = end.hung(motions.stamp_ns[covered])
    motion = motions.motion[covered] * (point_scale, point_scale, 1.0)
    count = len(motion)
    return RelativePoses(
        from_drive=np.full(count, start.index, dtype=np.int64),
        from_keyframe=from_keyframe,
        to_drive=np.full(count, end.index, dtype=np.int64),
        to_keyframe=to_keyframe,
        T_from_to=composed(composed(from_offset, motion), _inverted(to_offset)),
        covariance=_carried_to(to_offset, _in_end_frame(motion, motions.covariance[covered])),
    )


def _covers(prepared: PreparedDrive, stamp_ns: Ints) -> Bools:
    covered: Bools = (stamp_ns >= prepared.stamp_ns[0]) & (stamp_ns <= prepared.stamp_ns[-1])
    return covered


def _inverted(pose: Floats) -> Floats:
    """The poses (n, 3) of the frame each of `pose` (n, 3) is given in, seen from it."""
    return relative_poses(pose, np.zeros_like(pose))


def _in_end_frame(motion: Floats, covariance: Floats) -> Floats:
    """Covariances (n, 3, 3) with x and y along the axes of the motion's end instead of its start's."""
    turned = _rotations(-motion[:, 2])
    return turned @ covariance @ turned.transpose(0, 2, 1)


def _carried_to(offset: Floats, covariance: Floats) -> Floats:
    """Covariances (n, 3, 3) of a body at `offset` (n, 3) in a keyframe's frame as those of the keyframe: the adjoint
    (Sola et al. 2018, eq. 129)."""
    adjoint = _rotations(offset[:, 2])
    adjoint[:, 0, 2], adjoint[:, 1, 2] = offset[:, 1], -offset[:, 0]
    return adjoint @ covariance @ adjoint.transpose(0, 2, 1)


def _rotations(angle_rad: Floats) -> Floats:
    """Rotations (n, 3, 3) of x and y that leave heading alone."""
    c, s, zero, one = np.cos(angle_rad), np.sin(angle_rad), np.zeros(len(angle_rad)), np.ones(len(angle_rad))
    return np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1).reshape(-1, 3, 3)


def scaled(relative: RelativePoses, factor: float) -> RelativePoses:
    """The relative poses with their covariances multiplied."""
    return replace(relative, covariance=factor * relative.covariance)


def add_relative_poses(graph: gtsam.NonlinearFactorGraph, relative: RelativePoses, *, kernel: Kernel | None) -> None:
    """Every relative pose as a factor between its two keyframes; those within one keyframe say nothing of the graph."""
    start, end = (relative.from_drive, relative.from_keyframe), (relative.to_drive, relative.to_keyframe)
    for row in np.nonzero((start[0] != end[0]) | (start[1] != end[1]))[0]:
        key_from, key_to = (pose_key(int(drive[row]), int(keyframe[row])) for drive, keyframe in (start, end))
        noise = with_kernel(gtsam.noiseModel.Gaussian.Covariance(relative.covariance[row]), kernel)
        graph.add(gtsam.BetweenFactorPose2(key_from, key_to, gtsam.Pose2(*relative.T_from_to[row]), noise))


def between_keyframes(prepared: PreparedDrive, motions: MotionSeries) -> MotionSeries:
    """Motions from sweep to sweep composed to ones from the first sweep after a keyframe to the first after the next.

    Where the chain of sweeps is broken there is none.

    The errors of sweeps are taken as independent: each begins where the one before ended, whose error it therefore
    undoes, so that this claims too little rather than too much.
    """
    if not len(motions.stamp_ns):
        return motions
    covered = _covers(prepared, motions.from_stamp_ns) & _covers(prepared, motions.stamp_ns)
    motions = motions.chosen(covered)
    keyframe, _ = prepared.hung(motions.from_stamp_ns)
    broken = np.concatenate([[True], motions.from_stamp_ns[1:] != motions.stamp_ns[:-1]])
    first = np.nonzero(broken | (np.diff(keyframe, prepend=-1) != 0))[0]
    last = np.append(first[1:], len(keyframe)) - 1
    whole = _reaches_keyframe(prepared, motions.stamp_ns[last], keyframe[first])
    return _chained(motions, first, last).chosen(whole)


def _reaches_keyframe(prepared: PreparedDrive, stamp_ns: Ints, keyframe: Ints) -> Bools:
    """Whether what begins at a keyframe has come to another one at the stamp."""
    reached: Bools = prepared.hung(stamp_ns)[0] > keyframe
    return reached


def _chained(motions: MotionSeries, first: Ints, last: Ints) -> MotionSeries:
    """The motions of the rows `first` to `last` (k,) composed, each pair of rows one motion."""
    heading = np.cumsum(motions.motion[:, 2])
    before = heading - motions.motion[:, 2]
    c, s = np.cos(before), np.sin(before)
    x, y = motions.motion[:, 0], motions.motion[:, 1]
    end = np.cumsum(np.column_stack([c * x - s * y, s * x + c * y]), axis=0)
    start = np.column_stack([end - np.column_stack([c * x - s * y, s * x + c * y]), before])
    path = np.column_stack([end, heading])
    chain = np.repeat(np.arange(len(first)), last - first + 1)
    in_start = relative_poses(start[first][chain], path)  # each sweep's end as seen from its chain's start
    jacobian = _rotations(before - before[first][chain])
    lever = relative_poses(start[first][chain], path[last][chain])[:, :2] - in_start[:, :2]
    jacobian[:, 0, 2], jacobian[:, 1, 2] = -lever[:, 1], lever[:, 0]
    covariance = np.zeros((len(first), 3, 3))
    np.add.at(covariance, chain, jacobian @ motions.covariance @ jacobian.transpose(0, 2, 1))
    return replace(
        motions,
        from_stamp_ns=motions.from_stamp_ns[first],
        stamp_ns=motions.stamp_ns[last],
        motion=relative_poses(start[first], path[last]),
        covariance=covariance,
    )

"""A drive that goes round a block almost twice, with the loops it closes the second time round, some of them wrong."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from solved_worlds.examples import FRAME, START_NS, STEP_S, Lap, World, world
from trigpoint.events.drives import NO_DETECTIONS, Drive, LoopSeries, MotionSeries
from trigpoint.geodesy.poses import wrap_angles_rad
from trigpoint_optimisation.core.odometry import relative_poses

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LAP = Lap(duration_s=120.0, white_m=6.0, slow_m=0.0)
SIGMA = np.array([0.03, 0.03, 0.002])  # of a loop: m, m, rad
CLOSED_EVERY_S = 2.0
WRONG_M, WRONG_RAD = (3.0, 40.0), 1.0  # how far off wrong ones are


def around_without_landmarks() -> World:
    """The drive with nothing but wheels, gyroscope and bad fixes."""
    driven = world(LAP)
    return replace(driven, drives=tuple(replace(drive, detections=NO_DETECTIONS) for drive in driven.drives))


def with_loops(driven: World, *, wrong_share: float = 0.0, seed: int = 7) -> Drive:
    """Its drive with loops closed wherever it comes by again; a share of them is wrong."""
    rng = np.random.default_rng(seed)
    again, before = met(driven.poses[0])
    motion = relative_poses(driven.poses[0][before], driven.poses[0][again]) / (FRAME.point_scale, FRAME.point_scale, 1)
    motion = motion + rng.normal(0.0, SIGMA, motion.shape)
    drive = driven.drives[0]
    motions = MotionSeries(
        from_stamp_ns=_stamps(before),
        stamp_ns=_stamps(again),
        motion=motion,
        covariance=np.repeat(np.diag(SIGMA**2)[None], len(motion), axis=0),
    )
    loops = LoopSeries(other=((drive.vehicle, drive.boot_id),) * len(motion), motions=motions)
    return replace(drive, loops=spoiled(loops, wrong_share, rng))


def spoiled(loops: LoopSeries, share: float, rng: np.random.Generator) -> LoopSeries:
    """The loops, a share of them wrong: shifted by metres to tens of metres and turned by up to a radian."""
    motion = loops.motions.motion.copy()
    wrong = rng.choice(len(motion), round(share * len(motion)), replace=False)
    way, off_m = rng.uniform(0.0, 2.0 * np.pi, len(wrong)), rng.uniform(*WRONG_M, len(wrong))
    motion[wrong, :2] += off_m[:, None] * np.column_stack([np.cos(way), np.sin(way)])
    motion[wrong, 2] += rng.uniform(-WRONG_RAD, WRONG_RAD, len(wrong))
    motion[:, 2] = wrap_angles_rad(motion[:, 2])
    return replace(loops, motions=replace(loops.motions, motion=motion))


def met(pose: Floats) -> tuple[Ints, Ints]:
    """Rows at which the drive is within a metre of where it was half a minute before or earlier, and those of then."""
    step = round(CLOSED_EVERY_S / STEP_S)
    found = []
    for row in range(0, len(pose), step):
        away_m = np.hypot(*(pose[: max(row - round(30.0 / STEP_S), 0), :2] - pose[row, :2]).T)
        if len(away_m) and away_m.min() < 1.0:
            found.append((row, int(np.argmin(away_m))))
    again, before = np.array(found, dtype=np.int64).T
    return again, before


def _stamps(row: Ints) -> Ints:
    return START_NS + np.round(row * STEP_S * 1e9).astype(np.int64)

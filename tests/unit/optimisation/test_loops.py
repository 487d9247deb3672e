"""Closed loops in a solve: right ones straighten the path, wrong ones do not bend it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from looped_worlds.examples import around_without_landmarks, met, with_loops
from solved_worlds.examples import FRAME, START_NS, STEP_S
from trigpoint.events.drives import Drive
from trigpoint_optimisation.core.stages import solve_fleet
from trigpoint_optimisation.settings import Kernel, LoopSettings, OdometrySettings, SolveSettings

Floats = NDArray[np.float64]

SETTINGS = SolveSettings(method="loose", edges="honest", odometry=OdometrySettings(keyframe_m=6.0))
DRIVEN = around_without_landmarks()


@dataclass(frozen=True, slots=True)
class Off:
    """Mean distances in m: of the path from the truth, and of where it comes by again from where it should, as seen
    from where it was before."""

    path_m: float
    again_m: float


def off(drive: Drive, settings: SolveSettings = SETTINGS) -> Off:
    """How far off the drive is solved for."""
    solved = solve_fleet([drive], [], FRAME, settings)
    prepared, truth = solved.fleet.prepared[0], DRIVEN.poses[0]
    row = np.round((prepared.stamp_ns - START_NS) * 1e-9 / STEP_S).astype(np.int64)
    error_m = (solved.state.drives[0].pose - truth[row])[:, :2]
    again, before = (np.searchsorted(row, each) - 1 for each in met(truth))
    return Off(
        path_m=float(np.hypot(*error_m.T).mean()), again_m=float(np.hypot(*(error_m[again] - error_m[before]).T).mean())
    )


@pytest.fixture(scope="module")
def without() -> Off:
    """No loop closed."""
    return off(DRIVEN.drives[0])


@pytest.fixture(scope="module")
def right() -> Off:
    """Right loops only."""
    return off(with_loops(DRIVEN))


def test_loops_bring_the_path_back_to_where_it_was(without: Off, right: Off) -> None:
    assert right.again_m < 0.5 * without.again_m


@pytest.mark.parametrize("wrong_share", [0.1, 0.3])
def test_wrong_loops_leave_the_path_within_a_tenth(right: Off, wrong_share: float) -> None:
    found = off(with_loops(DRIVEN, wrong_share=wrong_share))
    assert found.path_m < 1.1 * right.path_m
    assert found.again_m < 1.1 * right.again_m


def test_believed_without_doubt_one_wrong_loop_would_bend_it(right: Off) -> None:
    trusting = replace(SETTINGS, loops=LoopSettings(widened_m=(), kernel=Kernel("cauchy", 300.0)))
    assert off(with_loops(DRIVEN, wrong_share=0.04), trusting).path_m > 10.0 * right.path_m


def test_loops_can_be_left_out_of_a_solve(without: Off) -> None:
    unused = replace(SETTINGS, loops=LoopSettings(used=False))
    assert off(with_loops(DRIVEN, wrong_share=0.3), unused) == without


def test_a_loop_with_a_drive_that_is_not_there_says_nothing(without: Off) -> None:
    drive = with_loops(DRIVEN)
    elsewhere = replace(drive, loops=replace(drive.loops, other=(("other", "boot"),) * len(drive.loops.other)))
    assert off(elsewhere) == without

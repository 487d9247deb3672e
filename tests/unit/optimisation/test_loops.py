"""Closed loops in a solve: right ones straighten the path, wrong ones do not bend it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from looped_worlds.examples import around_without_landmarks, with_loops
from solved_worlds.examples import FRAME, START_NS, STEP_S, World
from trigpoint.events.drives import Drive
from trigpoint_optimisation.core.stages import solve_fleet
from trigpoint_optimisation.settings import LoopSettings, OdometrySettings, SolveSettings

Floats = NDArray[np.float64]

SETTINGS = SolveSettings(method="loose", edges="honest", odometry=OdometrySettings(keyframe_m=6.0))
DRIVEN = around_without_landmarks()


def apart_m(drive: Drive, settings: SolveSettings = SETTINGS, driven: World = DRIVEN) -> float:
    """Mean distance between the second time round as solved for and as it truly was, seen from the first time."""
    solved = solve_fleet([drive], [], FRAME, settings)
    stamp_ns, pose = solved.fleet.prepared[0].stamp_ns, solved.state.drives[0].pose
    truth = driven.poses[0][np.round((stamp_ns - START_NS) * 1e-9 / STEP_S).astype(np.int64)]
    return float(np.hypot(*(pose - truth)[:, :2].T).mean())


@pytest.fixture(scope="module")
def clean_m() -> float:
    """The path's mean error with right loops only."""
    return apart_m(with_loops(DRIVEN))


def test_loops_lower_the_paths_error(clean_m: float) -> None:
    assert clean_m < 0.95 * apart_m(DRIVEN.drives[0])


@pytest.mark.parametrize("wrong_share", [0.1, 0.3])
def test_wrong_loops_leave_the_path_within_a_tenth(clean_m: float, wrong_share: float) -> None:
    assert apart_m(with_loops(DRIVEN, wrong_share=wrong_share)) < 1.1 * clean_m


def test_loops_can_be_left_out_of_a_solve(clean_m: float) -> None:
    unused = replace(SETTINGS, loops=LoopSettings(used=False))
    assert apart_m(with_loops(DRIVEN, wrong_share=0.3), unused) == pytest.approx(apart_m(DRIVEN.drives[0]))


def test_a_loop_with_a_drive_that_is_not_there_says_nothing() -> None:
    drive = with_loops(DRIVEN)
    elsewhere = replace(drive, loops=replace(drive.loops, other=(("other", "boot"),) * len(drive.loops.other)))
    assert apart_m(elsewhere) == pytest.approx(apart_m(DRIVEN.drives[0]))

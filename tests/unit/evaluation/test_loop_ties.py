"""Closed loops beside the sightings of a landmark."""

from dataclasses import replace

import numpy as np
import pytest

from event_examples.one_each import EVENTS
from trigpoint.events.envelope import LogPosition
from trigpoint.events.mapped import TrajectorySolved
from trigpoint.events.perceived import LoopClosed
from trigpoint_evaluation.core.explanation import DriveName, LoggedLoop, Sighting
from trigpoint_evaluation.core.loop_ties import LEG_NS, loops_behind

EXAMPLE = next(event for event in EVENTS if isinstance(event, LoopClosed))
ONE, OTHER = (EXAMPLE.vehicle, EXAMPLE.boot_id), (EXAMPLE.other_vehicle, EXAMPLE.other_boot_id)
STAMP_NS, OTHER_NS = 200 * LEG_NS, 100 * LEG_NS
CLOSED = replace(EXAMPLE, other_stamp_ns=OTHER_NS, x_m=1.0, y_m=3.0, heading_rad=-3.0)
PLACE = LogPosition("perception", 7)
LOOP = LoggedLoop(position=PLACE, stamp_ns=STAMP_NS, event=CLOSED)


def path(drive: DriveName, stamp_ns: int, pose: tuple[float, float, float]) -> TrajectorySolved:
    """A path that stands at a pose for two seconds."""
    return TrajectorySolved(
        map_version=1,
        vehicle=drive[0],
        boot_id=drive[1],
        stamp_ns=np.array([stamp_ns - LEG_NS, stamp_ns + LEG_NS]),
        pose=np.array([pose, pose]),
        covariance=np.zeros((2, 3, 3)),
        calibration=(),
    )


PATHS = {ONE: path(ONE, STAMP_NS, (7.0, 12.0, -2.0)), OTHER: path(OTHER, OTHER_NS, (10.0, 11.0, np.pi / 2))}


def seen(drive: DriveName, stamp_ns: int) -> Sighting:
    return Sighting(
        vehicle=drive[0],
        boot_id=drive[1],
        sequence=0,
        stamp_ns=stamp_ns,
        position=LogPosition("veh", 0),
        range_m=None,
        bearing_rad=None,
        off_m=None,
    )


@pytest.mark.parametrize(("drive", "stamp_ns"), [(ONE, STAMP_NS - LEG_NS), (OTHER, OTHER_NS + LEG_NS)])
def test_a_loop_ties_a_landmark_seen_at_either_of_its_ends(drive: DriveName, stamp_ns: int) -> None:
    (tied,) = loops_behind([LOOP], [seen(drive, stamp_ns)], PATHS)
    assert tied.loop == LOOP


@pytest.mark.parametrize(("drive", "stamp_ns"), [(ONE, STAMP_NS - LEG_NS - 1), (ONE, OTHER_NS), (OTHER, STAMP_NS)])
def test_a_loop_on_another_leg_ties_it_not(drive: DriveName, stamp_ns: int) -> None:
    assert loops_behind([LOOP], [seen(drive, stamp_ns)], PATHS) == ()


def test_what_the_map_leaves_of_a_loop_is_in_the_frame_of_its_other_sweep() -> None:
    (tied,) = loops_behind([LOOP], [seen(ONE, STAMP_NS)], PATHS)
    # the one is 3 m west and 1 m north of the other, which heads north: 1 m ahead, 3 m to the left, turned by -2 - pi/2
    assert tied.residual == pytest.approx((0.0, 0.0, -3.0 + 2.0 + np.pi / 2))


def test_a_loop_with_a_drive_that_has_no_path_is_left_out() -> None:
    assert loops_behind([LOOP], [seen(ONE, STAMP_NS)], {ONE: PATHS[ONE]}) == ()


def test_a_loop_off_the_end_of_a_path_has_no_residual() -> None:
    later = replace(LOOP, event=replace(CLOSED, other_stamp_ns=OTHER_NS + 2 * LEG_NS))
    (tied,) = loops_behind([later], [seen(ONE, STAMP_NS)], PATHS)
    assert tied.residual is None

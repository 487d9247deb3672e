"""What waits to be taken into a live map comes bit by bit: a drive found its place late, or the map began anew."""

from functools import cache
from typing import cast

import numpy as np

from solved_worlds.examples import FRAME, Lap, World, world
from solved_worlds.logged import all_accepted, drive_rows
from trigpoint.events.envelope import Envelope
from trigpoint.events.observed import Observed
from trigpoint_optimisation.core.live_fleet import LiveFleet
from trigpoint_optimisation.settings import SolveSettings

CAR = ("car", "boot")


@cache
def lap() -> World:
    return world(Lap(duration_s=70.0))


@cache
def car_rows() -> list[Envelope[Observed]]:
    return cast(list[Envelope[Observed]], drive_rows(lap().drives[0]))


def caught_up(fleet: LiveFleet) -> int:
    """How many steps it took."""
    steps = 0
    while fleet.catch_up()[0]:
        steps += 1
    return steps


def placed_late() -> LiveFleet:
    """The filter spoke of no fix before the last seconds of the drive."""
    fleet = LiveFleet(FRAME, SolveSettings())
    rows = car_rows()
    before = [place for row in rows[:-300] for place in fleet.take(row)]
    for verdict in all_accepted(rows[:-300]):
        fleet.judged(verdict)
    after = [place for row in rows[-300:] for place in fleet.take(row)]
    assert after
    assert not before
    return fleet


def off_poles_m(fleet: LiveFleet) -> list[float]:
    """How far each landmark told of is from the nearest pole."""
    off = [lap().pole_m - one.position_m for one in fleet.map.changed_landmarks(share=0.1)]
    return [float(np.hypot(*each.T).min()) for each in off]


def test_a_drive_placed_late_has_a_place_before_all_it_saw_is_in_the_map() -> None:
    fleet = placed_late()
    few = len(fleet.map.landmarks)
    assert caught_up(fleet) > 5
    assert len(fleet.map.landmarks) > few + 10
    assert np.median(off_poles_m(fleet)) < 3.0  # the error of the fixes, common to all


def test_a_map_begun_anew_catches_up_with_what_came_since() -> None:
    fleet = placed_late()
    caught_up(fleet)
    many = len(fleet.map.landmarks)
    fleet.begin_anew((), (), excluded=())
    assert (fleet.map.pose_count, len(fleet.map.landmarks)) == (0, 0)
    caught_up(fleet)
    assert len(fleet.map.landmarks) >= 0.9 * many


def test_a_drive_that_is_excluded_is_not_taken_into_the_map_begun_anew() -> None:
    fleet = placed_late()
    fleet.begin_anew((), (), excluded=[CAR])
    caught_up(fleet)
    assert (fleet.map.pose_count, fleet.map.is_placed(CAR)) == (0, False)


def test_the_same_events_give_the_same_map_to_the_last_digit() -> None:
    one, other = placed_late(), placed_late()
    assert caught_up(one) == caught_up(other)
    ours, theirs = (each.map.changed_landmarks(share=0.1) for each in (one, other))
    assert [(a.landmark, a.position_m.tolist(), a.covariance_m2.tolist()) for a in ours] == [
        (b.landmark, b.position_m.tolist(), b.covariance_m2.tolist()) for b in theirs
    ]

"""A drive's events in the log's order: sweeps wait for what was measured about them, sensors keep their turns."""

import math
import pickle
from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from scanned_worlds.casting import PERIOD_NS, SIXTEEN, START_NS, STREET, driven_pose, swept
from scanned_worlds.drives import VELOCITY, scanned_drive
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import ImuMeasured, Observed, VehicleDescribed, WheelSpeedMeasured
from trigpoint.events.perceived import LandmarksPerceived, OdometryMatched
from trigpoint.events.scanned import PointsScanned
from trigpoint_perception.core.drive_following import HELD_SWEEPS, DriveFollower, Told
from trigpoint_perception.core.fleet_following import FleetFollower
from trigpoint_perception.core.kept_map import KEPT_SWEEPS
from trigpoint_perception.core.motion_window import KEPT_S, MotionWindow
from trigpoint_perception.settings import PerceptionSettings

SETTINGS = PerceptionSettings()
SHORT_NS = 10_000_000
SPEED = WheelSpeedMeasured(speed_mps=VELOCITY[0], steering_rad=math.nan, yaw_rate_radps=VELOCITY[1])
TURN = ImuMeasured(yaw_rate_radps=VELOCITY[1], acceleration_x_mps2=0.0, acceleration_y_mps2=0.0)


def numbered(events: Sequence[tuple[int, Observed]]) -> list[Envelope[Observed]]:
    return [Envelope(EventIdentity("van", "boot-1", n), stamp, event) for n, (stamp, event) in enumerate(events)]


def sweep_at(number: int, *, sensor: str = "roof") -> PointsScanned:
    scanned = swept(STREET, SIXTEEN, pose=driven_pose(VELOCITY, 0.1 * number), velocity=VELOCITY)
    return replace(scanned, sensor=sensor)


def rows_of(sweeps: int, *, boot_id: str = "boot-1") -> list[Envelope[Observed]]:
    return cast(list[Envelope[Observed]], list(scanned_drive("van", sweeps, boot_id=boot_id)))


def follower() -> DriveFollower:
    return DriveFollower("van", "boot-1", SETTINGS)


def told_of(rows: Sequence[Envelope[Observed]]) -> list[Told]:
    one = follower()
    return [*(told for row in rows for told in one.take(row)), *one.finished()]


def sweeps_of(told: Sequence[Told]) -> list[int]:
    return [event.sweep_sequence for _, event in told if isinstance(event, LandmarksPerceived)]


def test_a_sweep_waits_until_wheels_and_gyroscope_reach_its_end() -> None:
    end_ns = START_NS + PERIOD_NS // 2
    before: list[tuple[int, Observed]] = [(START_NS - SHORT_NS, SPEED), (START_NS - SHORT_NS, TURN)]
    rows = numbered([*before, (START_NS, sweep_at(0)), (end_ns, SPEED), (end_ns - SHORT_NS, TURN), (end_ns, TURN)])
    one, perceived = follower(), []
    for row in rows:
        one.take(row)
        perceived.append(one.perceived)
    assert perceived == [0, 0, 0, 0, 0, 1]


def test_without_wheels_it_does_not_wait_and_where_they_ended_not_for_long() -> None:
    bare = follower()
    bare.take(numbered([(START_NS, sweep_at(0))])[0])
    assert bare.perceived == 1
    ended = follower()
    sweeps: list[tuple[int, Observed]] = [(START_NS + n * PERIOD_NS, sweep_at(n)) for n in range(1, 8)]
    for row in numbered([(START_NS, SPEED), *sweeps]):
        ended.take(row)
    assert 0 < 7 - ended.perceived <= min(6, HELD_SWEEPS)


def test_what_two_sensors_saw_is_told_in_the_order_of_their_sweeps() -> None:
    events: list[tuple[int, Observed]] = []
    for number in range(7):
        events.append((START_NS + number * PERIOD_NS, sweep_at(number)))
        if number < 3:  # the other one falls silent
            events.append((START_NS + number * PERIOD_NS + SHORT_NS, sweep_at(number, sensor="bumper")))
    rows = numbered(events)
    whole, one = told_of(rows), follower()
    halting = [
        told for row in rows for told in (*one.take(row), *(one.finished() if row.identity.sequence == 8 else ()))
    ]
    halting += one.finished()
    assert sweeps_of(whole) == list(range(10))
    assert [(type(event), event.sweep_sequence) for _, event in halting] == [
        (type(event), event.sweep_sequence) for _, event in whole
    ]


def test_the_path_about_a_sweep_is_what_was_driven() -> None:
    window = MotionWindow()
    events: list[tuple[int, Observed]] = [(START_NS - 1, VehicleDescribed(vehicle="van"))]
    events += [(START_NS + n * SHORT_NS, SPEED) for n in range(400)]
    for row in numbered(events):
        window.take(row)
    path = window.path(START_NS + 390 * SHORT_NS - PERIOD_NS, START_NS + 390 * SHORT_NS)
    assert path is not None
    assert len(path.stamp_ns) == PERIOD_NS // SHORT_NS + 1
    motion = path.position_m[-1] @ path.rotation[0].as_matrix() - path.position_m[0] @ path.rotation[0].as_matrix()
    assert motion[:2] == pytest.approx(driven_pose(VELOCITY, 0.1)[:2], abs=1e-5)
    assert window.path(START_NS, START_NS + SHORT_NS) is None  # more than KEPT_S ago
    assert KEPT_S < 4.0


def test_a_clock_that_steps_back_begins_the_window_anew() -> None:
    window, day_ns = MotionWindow(), 86_400_000_000_000
    for row in numbered([(START_NS + n * SHORT_NS, SPEED) for n in range(50)]):
        window.take(row)
    for row in numbered([(START_NS - day_ns + n * SHORT_NS, SPEED) for n in range(50)]):
        window.take(row)
    path = window.path(START_NS - day_ns, START_NS - day_ns + PERIOD_NS)
    assert path is not None
    assert path.stamp_ns[0] == START_NS - day_ns


def test_a_vehicle_has_its_newest_boots_followed_and_older_ones_given_out() -> None:
    fleet, told = FleetFollower(SETTINGS), list[tuple[str, int]]()
    for boot_id in ("one", "two", "three"):
        for row in rows_of(1, boot_id=boot_id):
            told += [(name[1], event.sweep_sequence) for name, some in fleet.take(row) for _, event in some]
    assert told == [("one", 2)]
    assert sorted(boot_id for _, boot_id in fleet.waiting()) == ["three", "two"]
    late = rows_of(1, boot_id="one")[0]
    assert list(fleet.take(late)) == []


def test_pickled_in_the_middle_it_goes_on_as_if_nothing_was() -> None:
    rows = rows_of(8)
    one = follower()
    told = [each for row in rows[:9] for each in one.take(row)]
    one = pickle.loads(pickle.dumps(one))
    told += [each for row in rows[9:] for each in one.take(row)] + one.finished()
    assert repr(told) == repr(told_of(rows))


def motions_of(told: Sequence[Told]) -> list[OdometryMatched]:
    return [event for _, event in told if isinstance(event, OdometryMatched)]


def landmarks_of(told: Sequence[Told]) -> list[str]:
    return [repr(event) for _, event in told if isinstance(event, LandmarksPerceived)]


@pytest.mark.slow
def test_pickled_late_in_a_long_drive_it_goes_on_within_what_it_claims() -> None:
    rows = rows_of(KEPT_SWEEPS + 60)
    one, at = follower(), 2 * (KEPT_SWEEPS + 40)
    told = [each for row in rows[:at] for each in one.take(row)]
    one = pickle.loads(pickle.dumps(one))
    told += [each for row in rows[at:] for each in one.take(row)] + one.finished()
    whole = told_of(rows)
    assert landmarks_of(told) == landmarks_of(whole)
    for ours, theirs in zip(motions_of(told), motions_of(whole), strict=True):
        off = np.array([ours.x_m - theirs.x_m, ours.y_m - theirs.y_m, ours.heading_rad - theirs.heading_rad])
        assert off @ np.linalg.solve(theirs.covariance, off) < 0.1  # a third of a sigma

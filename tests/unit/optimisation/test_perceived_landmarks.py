"""What perception found in points is solved as what a landmark sensor detected."""

import math

import numpy as np
import pytest

from solved_worlds.examples import Lap, World, world
from solved_worlds.logged import append_world
from solved_worlds.perceived import VARIANCE_M2, by_perception
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope
from trigpoint.events.mapped import LandmarkSolved
from trigpoint.events.observed import LandmarksDetected, VehicleDescribed
from trigpoint.landmarks.memory_store import MemoryStore
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.perceived_readings import PERCEIVED_STREAM
from trigpoint.logs.readings import logged_maps
from trigpoint_evaluation.explaining import explained
from trigpoint_landmarks.app import project
from trigpoint_optimisation.app import build, input_positions
from trigpoint_optimisation.settings import OdometrySettings, SolveSettings

SETTINGS = SolveSettings(method="anchored", odometry=OdometrySettings(keyframe_m=4.0))  # coarse: quick
SIGHT_M = math.sqrt(VARIANCE_M2)  # sights weighed otherwise move a landmark by less


@pytest.fixture(scope="module")
def block() -> World:
    return world(Lap(duration_s=75.0), Lap(vehicle="van", begin_rad=3.5, seed=2, duration_s=50.0))


@pytest.fixture(scope="module")
def detected(block: World) -> MemoryLog:
    log = MemoryLog()
    append_world(log, block)
    return log


@pytest.fixture(scope="module")
def perceived(detected: MemoryLog) -> MemoryLog:
    """The same drives, without a detection of theirs, and perception's word of each in its place."""
    log, found = MemoryLog(), list[Envelope[Event]]()
    for stream in detected.streams():
        rows = [row.envelope for row in detected.read(stream)]
        described = next((row.event for row in rows if isinstance(row.event, VehicleDescribed)), None)
        if described is not None:
            found += [by_perception(row, described, len(found) + n) for n, row in enumerate(sweeps_of(rows))]
        log.append(stream, [row for row in rows if not isinstance(row.event, LandmarksDetected)])
    log.append(PERCEIVED_STREAM, found)
    return log


def sweeps_of(rows: list[Envelope[Event]]) -> list[Envelope[Event]]:
    return [row for row in rows if isinstance(row.event, LandmarksDetected)]


@pytest.fixture(scope="module")
def from_points(perceived: MemoryLog) -> list[LandmarkSolved]:
    return placed(perceived)


def placed(log: MemoryLog) -> list[LandmarkSolved]:
    build(log, SETTINGS)
    return sorted(logged_maps(log)[-1].landmarks, key=lambda one: one.observations)


def test_a_map_from_points_is_the_map_from_the_same_detections(
    detected: MemoryLog, from_points: list[LandmarkSolved]
) -> None:
    ours, theirs = from_points, placed(detected)
    assert [one.observations for one in ours] == [one.observations for one in theirs]
    assert np.abs(np.array([one.position_m for one in ours]) - [one.position_m for one in theirs]).max() < SIGHT_M


def test_a_landmark_is_no_surer_than_what_its_sights_share(from_points: list[LandmarkSolved]) -> None:
    shared_m2 = SETTINGS.detections.shared_share * VARIANCE_M2
    for one in from_points:
        passes = len(one.vehicles) * 2  # each goes round once and a bit
        assert np.linalg.eigvalsh(one.covariance_m2)[0] > 0.9 * shared_m2 / passes


def test_a_map_says_how_far_it_took_perception_in(detected: MemoryLog, perceived: MemoryLog) -> None:
    assert dict(input_positions(perceived))[PERCEIVED_STREAM] == perceived.next_number(PERCEIVED_STREAM)
    assert PERCEIVED_STREAM not in dict(input_positions(detected))


def test_behind_a_landmark_stands_what_perception_said(perceived: MemoryLog, from_points: list[LandmarkSolved]) -> None:
    store, landmark = MemoryStore(), from_points[0]
    project(perceived, store)
    found = explained(perceived, store, landmark.landmark)
    seen = {(one.vehicle, one.boot_id, one.sequence) for one in found.sightings}
    assert (seen, found.missing) == (set(landmark.observations), 0)
    assert {one.position.stream for one in found.sightings} == {PERCEIVED_STREAM}
    assert max(one.off_m for one in found.sightings if one.off_m is not None) < 1.0

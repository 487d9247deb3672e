"""A map built after a retraction and an exclusion is as if the anchor and the drive had never been."""

from dataclasses import replace

import numpy as np
import pytest

from solved_worlds.examples import Lap, World, world
from solved_worlds.logged import append_world
from trigpoint.events.solved import SolvedMap
from trigpoint.logs.as_of import log_as_of
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.readings import (
    LABEL_STREAM,
    logged_anchors,
    logged_drives,
    logged_frame,
    logged_maps,
    logged_verdicts,
)
from trigpoint_ingest.anchors import import_anchors
from trigpoint_ingest.core.anchors import LabelledAnchors
from trigpoint_ingest.corrections import Attribution, exclude_drives, include_drives, retract_anchor
from trigpoint_optimisation.app import build
from trigpoint_optimisation.core.solve import solve_map
from trigpoint_optimisation.settings import OdometrySettings, SolveSettings

SETTINGS = SolveSettings(method="anchored", odometry=OdometrySettings(keyframe_m=4.0))  # coarse: quick
SAME_M = 1e-9
BY = Attribution(author="operator", reason="in a test", stamp_ns=0)


@pytest.fixture(scope="module")
def everything() -> World:
    return world(Lap(duration_s=75.0), Lap(vehicle="van", begin_rad=3.5, seed=2, duration_s=50.0))


def built(log: MemoryLog) -> SolvedMap:
    build(log, SETTINGS)
    return logged_maps(log)[-1]


@pytest.fixture(scope="module")
def corrected(everything: World) -> MemoryLog:
    """Version 1 of everything, 2 without the van and one anchor, 3 with both again."""
    log, gone = MemoryLog(), everything.anchors[0]
    append_world(log, everything)
    build(log, SETTINGS)
    exclude_drives(log, "van", boot_id=None, by=BY)
    retract_anchor(log, gone.anchor, image=gone.image, by=BY)
    build(log, SETTINGS)
    include_drives(log, "van", boot_id=None, by=BY)
    import_anchors(LabelledAnchors((gone,), ()), log)
    build(log, SETTINGS)
    return log


def assert_same_landmarks(one: SolvedMap, other: SolvedMap) -> None:
    """Position by position and covariance by covariance; names apart."""
    assert len(one.landmarks) == len(other.landmarks) > 20
    ours, theirs = (sorted(each.landmarks, key=lambda row: tuple(row.position_m)) for each in (one, other))
    assert np.abs(np.array([a.position_m - b.position_m for a, b in zip(ours, theirs, strict=True)])).max() < SAME_M
    covariance = [a.covariance_m2 - b.covariance_m2 for a, b in zip(ours, theirs, strict=True)]
    assert np.abs(np.array(covariance)).max() < SAME_M


def test_without_the_drive_and_the_anchor_the_map_is_as_if_they_had_never_been(
    corrected: MemoryLog, everything: World
) -> None:
    never = MemoryLog()
    append_world(never, replace(everything, drives=everything.drives[:1], anchors=everything.anchors[1:]))
    without = logged_maps(corrected)[1]
    assert_same_landmarks(without, built(never))
    assert {path.vehicle for path in without.trajectories} == {"car"}
    assert {row.anchor for row in without.anchors} == {label.anchor for label in everything.anchors[1:]}


def test_with_both_again_the_map_is_the_first_one(corrected: MemoryLog) -> None:
    first, _, third = logged_maps(corrected)
    assert_same_landmarks(first, third)
    assert len(first.trajectories) == len(third.trajectories) == 2


def test_without_them_the_map_is_another_one(corrected: MemoryLog) -> None:
    first, second, _ = logged_maps(corrected)
    with pytest.raises(AssertionError):
        assert_same_landmarks(first, second)


def test_each_version_says_how_far_it_read_the_corrections(corrected: MemoryLog, everything: World) -> None:
    labels = len(everything.anchors)
    read = [dict(one.head.inputs)[LABEL_STREAM] for one in logged_maps(corrected)]
    assert read == [labels, labels + 2, labels + 4]


def test_a_version_is_solved_again_from_the_log_as_its_inputs_say(corrected: MemoryLog) -> None:
    second = logged_maps(corrected)[1]
    then = log_as_of(corrected, second)
    again = solve_map(
        logged_drives(then), logged_anchors(then), logged_frame(then), SETTINGS, verdicts=logged_verdicts(then)
    )
    assert_same_landmarks(second, again.map)

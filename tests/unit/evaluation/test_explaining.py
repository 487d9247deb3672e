"""What stands behind a landmark: every sweep, label and correction, with its place in the log."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from landmark_maps.examples import (
    START_NS,
    append_mapped,
    associated,
    closing,
    pin_frame,
    solved_landmark,
    solved_trajectory,
)
from solved_worlds.examples import STEP_S, Lap, World, world
from solved_worlds.logged import append_world, drive_rows
from trigpoint.errors import InputError
from trigpoint.events.codec import Event
from trigpoint.events.corrected import AnchorLabelled, AnchorRetracted, DriveExcluded
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.mapped import LandmarkSolved
from trigpoint.events.observed import LandmarkDetection, LandmarksDetected, VehicleDescribed
from trigpoint.events.perceived import LoopClosed
from trigpoint.landmarks.memory_store import MemoryStore
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import logged_maps
from trigpoint_evaluation.core.explanation import Explanation
from trigpoint_evaluation.core.loop_ties import LEG_NS
from trigpoint_evaluation.explaining import explained
from trigpoint_ingest.corrections import Attribution, exclude_drives, retract_anchor
from trigpoint_landmarks.app import project
from trigpoint_optimisation.app import build
from trigpoint_optimisation.core.odometry import relative_poses
from trigpoint_optimisation.settings import OdometrySettings, SolveSettings

SETTINGS = SolveSettings(method="anchored", odometry=OdometrySettings(keyframe_m=4.0))  # coarse: quick
BY = Attribution(author="operator", reason="antenna came loose", stamp_ns=1)
NEAR_M = 1.0  # range within 0.1 m, bearing within 0.005 rad, poses within some decimetres
GROUP = 200  # events a chunk


@dataclass(frozen=True, slots=True, kw_only=True)
class Mapped:
    """A log with two map versions, the second without the van and one label; a landmark both had to do with."""

    log: MemoryLog
    store: MemoryStore
    landmark: LandmarkSolved
    anchor: AnchorLabelled


@pytest.fixture(scope="module")
def block() -> World:
    return world(Lap(duration_s=75.0), Lap(vehicle="van", begin_rad=3.5, seed=2, duration_s=50.0))


@pytest.fixture(scope="module")
def mapped(block: World) -> Mapped:
    log, store = MemoryLog(), MemoryStore()
    append_world(log, block)
    loops = met(block)
    log.append("perception", loops)
    build(log, SETTINGS)
    log.append("perception", [replace(row, identity=replace(row.identity, boot_id="later")) for row in loops])
    (first,) = logged_maps(log)
    landmark = next(
        one
        for one in first.landmarks
        if one.anchors and one.vehicles == ("car", "van") and one.observations[0][0] == "car"
    )
    anchor = next(label for label in block.anchors if label.anchor == landmark.anchors[0])
    exclude_drives(log, "van", boot_id=None, by=BY)
    retract_anchor(log, anchor.anchor, image=anchor.image, by=BY)
    build(log, SETTINGS)
    project(log, store)
    return Mapped(log=log, store=store, landmark=landmark, anchor=anchor)


def met(block: World) -> list[Envelope[Event]]:
    """A loop wherever the van drives within 3 m of where the car was, looked at every two seconds."""
    (car, van), (stamp_ns, van_ns) = block.poses, (drive.wheels.stamp_ns for drive in block.drives)
    rows: list[Envelope[Event]] = []
    for row in range(0, len(van), round(2.0 / STEP_S)):
        before = int(np.argmin(np.hypot(*(car[:, :2] - van[row, :2]).T)))
        x_m, y_m, heading_rad = relative_poses(car[[before]], van[[row]])[0].tolist()
        event = LoopClosed(
            vehicle="van",
            boot_id=block.drives[1].boot_id,
            sensor="roof",
            sweep_sequence=row,
            other_vehicle="car",
            other_boot_id=block.drives[0].boot_id,
            other_sensor="roof",
            other_sequence=before,
            other_stamp_ns=int(stamp_ns[before]),
            x_m=x_m,
            y_m=y_m,
            heading_rad=heading_rad,
            covariance=np.diag([0.01, 0.01, 1e-4]),
            matched_share=0.7,
            pairs=9,
        )
        if math.hypot(x_m, y_m) < 3.0:
            rows.append(Envelope(EventIdentity("perception", "loops", len(rows)), int(van_ns[row]), event))
    return rows


@pytest.fixture(scope="module")
def first(mapped: Mapped) -> Explanation:
    return explained(mapped.log, mapped.store, mapped.landmark.landmark, as_of=1)


@pytest.fixture(scope="module")
def second(mapped: Mapped) -> Explanation:
    return explained(mapped.log, mapped.store, mapped.landmark.landmark)


def test_every_observation_of_the_map_version_is_there(first: Explanation, mapped: Mapped) -> None:
    seen = {(one.vehicle, one.boot_id, one.sequence) for one in first.sightings}
    assert seen == set(mapped.landmark.observations)
    assert (first.missing, first.map_version) == (0, 1)


def test_an_observation_stands_in_the_log_where_it_says(first: Explanation, mapped: Mapped) -> None:
    one = first.sightings[0]
    logged = next(mapped.log.read(one.position.stream, first_number=one.position.number))
    sweep = cast(LandmarksDetected, logged.envelope.event)
    assert (logged.envelope.identity.sequence, logged.envelope.stamp_ns) == (one.sequence, one.stamp_ns)
    assert (one.range_m, one.bearing_rad) in [(seen.range_m, seen.bearing_rad) for seen in sweep.detections]


def test_of_a_sweep_the_detection_of_this_landmark_is_named(first: Explanation) -> None:
    assert max(one.off_m for one in first.sightings if one.off_m is not None) < NEAR_M
    assert all(one.off_m is not None for one in first.sightings)


def test_a_tied_anchor_comes_with_its_residual_and_its_image_s_offset(first: Explanation, mapped: Mapped) -> None:
    solved = logged_maps(mapped.log)[0]
    (tied,) = first.anchors
    associated = next(one for one in solved.anchors if one.landmark == mapped.landmark.landmark)
    offset = next(one for one in solved.images if one.image == mapped.anchor.image)
    assert (tied.anchor, tied.image, tied.reason) == (mapped.anchor.anchor, mapped.anchor.image, associated.reason)
    assert (tied.residual_m, tied.offset_m) == (tuple(associated.residual_m), tuple(offset.offset_m))
    logged = next(mapped.log.read(tied.position.stream, first_number=tied.position.number))
    assert logged.envelope.event == replace(associated, residual_m=logged.envelope.event.residual_m)  # type: ignore[union-attr]


def test_loops_on_the_legs_it_was_seen_from_come_with_what_the_map_leaves_of_them(first: Explanation) -> None:
    seen_ns = np.array([one.stamp_ns for one in first.sightings])
    ends_ns = np.array([(one.loop.stamp_ns, one.loop.event.other_stamp_ns) for one in first.loops])
    assert np.abs(ends_ns[:, :, None] - seen_ns).min(axis=(1, 2)).max() <= LEG_NS
    residuals = np.array([one.residual for one in first.loops])
    assert np.hypot(*residuals[:, :2].T).max() < 0.3  # m: loops and sightings hold both drives together
    assert np.abs(residuals[:, 2]).max() < 0.02


def test_a_loop_stands_in_the_log_where_it_says_and_one_that_came_later_is_not_told_of(
    first: Explanation, mapped: Mapped
) -> None:
    loop = first.loops[0].loop
    logged = next(mapped.log.read(loop.position.stream, first_number=loop.position.number))
    assert (logged.envelope.event, logged.envelope.stamp_ns) == (loop.event, loop.stamp_ns)
    assert logged.envelope.identity.boot_id == "loops"


def test_a_loop_with_a_drive_that_was_left_out_is_not_behind_it(second: Explanation) -> None:
    assert second.loops == ()


def test_corrections_say_who_and_whether_the_version_heeded_them(first: Explanation, second: Explanation) -> None:
    kinds = [type(one.event) for one in second.corrections]
    assert kinds == [AnchorLabelled, DriveExcluded, AnchorRetracted]
    assert [one.heeded for one in first.corrections] == [True, False, False]
    assert [one.heeded for one in second.corrections] == [True, True, True]


def test_after_the_corrections_neither_drive_nor_anchor_is_behind_it(second: Explanation) -> None:
    assert {one.vehicle for one in second.sightings} == {"car"}
    assert second.anchors == ()


def test_each_version_in_which_it_moved_says_by_how_much(second: Explanation, mapped: Mapped) -> None:
    new, moved = second.moves
    assert (new.map_version, new.until, new.moved_m, new.anchors) == (1, 2, None, mapped.landmark.anchors)
    assert (moved.map_version, moved.until, moved.anchors) == (2, None, ())
    assert moved.moved_m is not None
    assert 0.0 < moved.moved_m < 3.0 * (new.sigma_major_m + moved.sigma_major_m)


def test_a_version_knows_nothing_of_later_ones(first: Explanation) -> None:
    assert [one.map_version for one in first.moves] == [1]


def test_an_unknown_landmark_is_refused_with_those_like_it(mapped: Mapped) -> None:
    name = mapped.landmark.landmark
    with pytest.raises(InputError, match=rf"'{name}x': the map never had one.* version 2 has '{name}'"):
        explained(mapped.log, mapped.store, f"{name}x")


def test_an_unknown_version_is_refused_with_those_there_are(mapped: Mapped) -> None:
    with pytest.raises(InputError, match="map version 7 is unknown: 1 to 2 are there"):
        explained(mapped.log, mapped.store, mapped.landmark.landmark, as_of=7)


def test_a_landmark_of_another_version_is_told_where_it_is(mapped: Mapped) -> None:
    before, after = ({row.landmark for row in solved.landmarks} for solved in logged_maps(mapped.log))
    gone = sorted(before - after)[0]
    with pytest.raises(InputError, match=rf"'{gone}' is not in map version 2, it is in versions 1 to 1"):
        explained(mapped.log, mapped.store, gone)


def test_only_the_time_it_was_seen_in_is_read(block: World, tmp_path: Path) -> None:
    car = replace(block, drives=block.drives[:1])
    log, store = McapLog(tmp_path / "log"), MemoryStore()
    append_world(log, replace(car, drives=()))
    _append_in_groups(log, car)
    build(log, SETTINGS)
    project(log, store)
    seen_shortly = min(logged_maps(log)[0].landmarks, key=lambda one: one.last_seen_ns - one.first_seen_ns)
    before = log.read_counts.chunks
    found = explained(log, store, seen_shortly.landmark)
    chunks = len(drive_rows(car.drives[0])) // GROUP
    log.close()
    assert len(found.sightings) == len(seen_shortly.observations)
    assert log.read_counts.chunks - before < chunks / 2


def _append_in_groups(log: EventLog, driven: World) -> None:
    """The first drive's events, each group durable before the next: a chunk each."""
    rows = drive_rows(driven.drives[0])
    for start in range(0, len(rows), GROUP):
        log.append(f"veh-{driven.drives[0].vehicle}", rows[start : start + GROUP])


def test_an_anchor_let_go_by_a_later_change_is_tied_no_more_and_a_path_comes_from_the_next_whole_version() -> None:
    log, store = MemoryLog(), MemoryStore()
    pin_frame(log)
    described = VehicleDescribed(vehicle="veh-a")
    seen = LandmarkDetection(range_m=5.0, bearing_rad=0.0, kind="pole", signature="", diameter_m=0.2)
    other = replace(seen, range_m=40.0)
    sweep = LandmarksDetected(detections=(other, seen))
    events: list[Event] = [described, sweep, sweep]
    log.append(
        "veh-veh-a",
        [
            Envelope(EventIdentity("veh-a", "boot-1", sequence), START_NS + sequence * 100_000_000, event)
            for sequence, event in enumerate(events)
        ],
    )
    landmark = replace(
        solved_landmark("L1", 5.0, 0.0), observations=(("veh-a", "boot-1", 1), ("veh-a", "boot-1", 2)), anchors=()
    )
    tied = replace(associated("anchor-1", "L1"), image="tile-1")
    append_mapped(log, [landmark, tied, closing(1, 1)])
    change = replace(closing(2, 1), base_version=1)
    since = replace(landmark, map_version=2, position_m=landmark.position_m + 0.1, observations=())  # moved, not seen
    append_mapped(log, [since, replace(tied, map_version=2, landmark=""), change])
    append_mapped(
        log, [replace(landmark, map_version=3), solved_trajectory(map_version=3), closing(3, 1)], boot_id="boot-2"
    )
    project(log, store)
    found = explained(log, store, "L1", as_of=2)
    assert (len(explained(log, store, "L1", as_of=1).anchors), found.anchors) == (1, ())
    assert [one.range_m for one in found.sightings] == [5.0, 5.0]  # the path drives east at 10 m/s from the origin

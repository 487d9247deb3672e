"""From the log into a store: from the checkpoint on, whole versions only."""

import pytest

from landmark_maps.examples import (
    MAP_STREAM,
    append_labels,
    append_mapped,
    label,
    pin_frame,
    solved_landmark,
    solved_map,
)
from trigpoint.errors import InputError
from trigpoint.landmarks.memory_store import MemoryStore
from trigpoint.landmarks.model import Anchor
from trigpoint.landmarks.queries import LandmarkQuery
from trigpoint.logs.memory_log import MemoryLog
from trigpoint_landmarks.app import ProjectionReport, project


@pytest.fixture
def log() -> MemoryLog:
    """A log with a pinned frame, two labels, and a map version of one landmark."""
    log = MemoryLog()
    pin_frame(log)
    append_labels(log, [label("anchor-1"), label("anchor-2")])
    append_mapped(log, solved_map(1, [solved_landmark("L1", 0.0, 0.0)], labels=2))
    return log


def test_a_version_in_the_log_is_taken_in(log: MemoryLog) -> None:
    store = MemoryStore()
    assert project(log, store) == ProjectionReport(applied=(1,), refused=(), map_version=1, landmark_count=1)
    assert [row.landmark for row in store.landmarks(LandmarkQuery())] == ["L1"]


def test_nothing_is_taken_in_twice(log: MemoryLog) -> None:
    store = MemoryStore()
    project(log, store)
    assert project(log, store) == ProjectionReport(applied=(), refused=(), map_version=1, landmark_count=1)


def test_projecting_as_versions_come_and_all_at_once_give_the_same_rows(log: MemoryLog) -> None:
    followed, caught_up = MemoryStore(), MemoryStore()
    project(log, followed)
    append_labels(log, [label("anchor-1", lat_deg=-33.8)])
    append_mapped(log, solved_map(2, [solved_landmark("L1", 0.0, 1.0, map_version=2)], labels=3))
    project(log, followed)
    project(log, caught_up)
    assert set(followed.rows()) == set(caught_up.rows())
    assert followed.checkpoint() == caught_up.checkpoint()


def test_an_open_version_is_taken_in_once_it_is_closed(log: MemoryLog) -> None:
    store = MemoryStore()
    events = solved_map(2, [solved_landmark("L2", 5.0, 5.0, map_version=2)])
    append_mapped(log, events[:3])
    assert project(log, store).applied == (1,)
    append_mapped(log, events[3:])
    assert project(log, store).applied == (2,)
    assert [row.landmark for row in store.landmarks(LandmarkQuery())] == ["L2"]


def test_a_version_with_missing_landmarks_is_refused_and_the_next_one_goes_on(log: MemoryLog) -> None:
    append_mapped(log, solved_map(2, [solved_landmark("L2", 0.0, 0.0, map_version=2)])[-1:])
    append_mapped(log, solved_map(3, [solved_landmark("L3", 0.0, 0.0, map_version=3)]))
    report = project(log, MemoryStore())
    assert report.applied == (1, 3)
    assert report.refused == ((2, "MapSolved counts 1 landmarks: 0 are in the log"),)


def test_anchors_stand_where_they_were_labelled_when_the_map_was_solved(log: MemoryLog) -> None:
    append_labels(log, [label("anchor-1", lat_deg=-33.8)])
    store = MemoryStore()
    project(log, store)
    assert {row.anchor: row.lat_deg for row in store.rows() if isinstance(row, Anchor)} == {
        "anchor-1": -33.89,
        "anchor-2": -33.89,
    }


def test_map_versions_without_a_pinned_frame_are_refused() -> None:
    log = MemoryLog()
    append_mapped(log, solved_map(1, [solved_landmark("L1", 0.0, 0.0)]))
    with pytest.raises(InputError, match="the log pins no map frame"):
        project(log, MemoryStore())


def test_an_empty_log_makes_an_empty_map() -> None:
    report = project(MemoryLog(), MemoryStore())
    assert report == ProjectionReport(applied=(), refused=(), map_version=None, landmark_count=0)


def test_progress_ends_at_the_number_of_events(log: MemoryLog) -> None:
    seen: list[tuple[int, int]] = []
    project(log, MemoryStore(), progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (log.next_number(MAP_STREAM), log.next_number(MAP_STREAM))

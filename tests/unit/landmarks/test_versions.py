"""Which events make a map version."""

from dataclasses import replace

import numpy as np

from landmark_maps.examples import MAP_STREAM, closing, logged, solved_landmark, solved_map
from trigpoint.events.envelope import LogPosition
from trigpoint.events.mapped import Mapped
from trigpoint.events.runs import LoggedRun
from trigpoint_landmarks.core.versions import SolvedVersion, refusal_of, solved_versions


def versions(*parts: list[LoggedRun]) -> list[SolvedVersion]:
    return list(solved_versions(row for part in parts for row in part))


def names(version: SolvedVersion) -> list[str]:
    return list(version.landmarks.landmarks)


def test_a_version_has_all_its_events_and_the_place_of_the_last() -> None:
    (version,) = versions(logged(solved_map(1, [solved_landmark("L1", 0.0, 0.0)])))
    counts = len(version.landmarks), len(version.trajectories), len(version.anchors), len(version.image_offsets)
    assert (counts, version.position) == ((1, 1, 2, 1), LogPosition(MAP_STREAM, 5))


def test_a_version_that_was_never_closed_is_not_there() -> None:
    assert versions(logged(solved_map(1, [solved_landmark("L1", 0.0, 0.0)])[:-1])) == []


def test_what_a_writer_that_was_cut_off_left_is_not_part_of_the_next_solve() -> None:
    cut_off = logged([solved_landmark("ghost", 5.0, 5.0)], boot_id="boot-1")
    (version,) = versions(cut_off, logged(solved_map(1, [solved_landmark("L1", 0.0, 0.0)]), boot_id="boot-2", first=1))
    assert names(version) == ["L1"]


def test_a_solve_tried_again_in_the_same_boot_counts_once_as_said_last() -> None:
    tried = logged([solved_landmark("L1", 5.0, 5.0)])
    (version,) = versions(tried, logged(solved_map(1, [solved_landmark("L1", 0.0, 0.0)]), first=1))
    assert version.landmarks.positions_m.tolist() == [[0.0, 0.0]]


def test_events_of_another_version_number_are_left_out() -> None:
    old = solved_landmark("old", 0.0, 0.0, map_version=1)
    events: list[Mapped] = [old, *solved_map(2, [solved_landmark("L1", 0.0, 0.0, map_version=2)])]
    (version,) = versions(logged(events))
    assert names(version) == ["L1"]


def test_a_version_with_a_landmark_too_few_is_refused_with_both_counts() -> None:
    (version,) = versions(logged([solved_landmark("L1", 0.0, 0.0), closing(1, 2)]))
    assert refusal_of(version, newest=0, valid=()) == "MapSolved counts 2 landmarks: 1 are in the log"


def test_a_version_not_after_the_newest_is_refused() -> None:
    (version,) = versions(logged(solved_map(4, [solved_landmark("L1", 0.0, 0.0, map_version=4)])))
    assert refusal_of(version, newest=4, valid=()) == "map version 4 does not come after 4"
    assert refusal_of(version, newest=3, valid=()) == ""


def test_a_landmark_at_no_finite_place_refuses_its_version() -> None:
    (version,) = versions(logged(solved_map(1, [solved_landmark("L1", float("nan"), 0.0)])))
    assert refusal_of(version, newest=0, valid=()) == "landmark 'L1' has a position or covariance that is not finite"


def test_an_empty_map_is_a_version() -> None:
    (version,) = versions(logged([closing(1, 0)]))
    assert (names(version), refusal_of(version, newest=0, valid=())) == ([], "")


def test_arrays_are_taken_as_they_are() -> None:
    (version,) = versions(logged(solved_map(1, [solved_landmark("L1", 0.1, 0.2)])))
    assert np.array_equal(version.landmarks.positions_m, [[0.1, 0.2]])


def changing(
    map_version: int, base_version: int, landmark_count: int, *, removed: tuple[str, ...] = ()
) -> SolvedVersion:
    """A version that names L1 as changed."""
    head = replace(closing(map_version, landmark_count), base_version=base_version, removed=removed)
    (version,) = versions(logged([solved_landmark("L1", 0.0, 0.0, map_version=map_version), head]))
    return version


def test_a_change_of_the_newest_version_is_taken() -> None:
    assert refusal_of(changing(4, 3, 2), newest=3, valid=("L1", "L2")) == ""


def test_a_change_counts_what_comes_and_what_goes() -> None:
    assert refusal_of(changing(4, 3, 2, removed=("L2",)), newest=3, valid=("L2", "L3")) == ""
    wrong = refusal_of(changing(4, 3, 3, removed=("L2",)), newest=3, valid=("L2", "L3"))
    assert wrong == "MapSolved counts 3 landmarks: 2 are in the log"


def test_a_change_of_a_version_that_is_not_held_is_refused_with_both() -> None:
    reason = refusal_of(changing(4, 2, 1), newest=3, valid=("L1",))
    assert reason == "map version 4 is a change of 2: 3 is held"


def test_a_name_no_database_keeps_refuses_its_version() -> None:
    (version,) = versions(logged(solved_map(1, [solved_landmark("L\0", 0.0, 0.0)])))
    assert "U+0000" in refusal_of(version, newest=0, valid=())

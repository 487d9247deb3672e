"""The landmarks of a live map: found by place and by signature, told of when they are new, moved or known better."""

from types import SimpleNamespace
from typing import cast

import numpy as np

from trigpoint_optimisation.core.live_landmarks import LiveLandmarks
from trigpoint_optimisation.core.live_tracks import Seen, Track


def poles(*east_m: float) -> LiveLandmarks:
    """Poles along the east axis."""
    known = LiveLandmarks(())
    for metres in east_m:
        known.add("lm", np.array([metres, 0.0]), kind="pole", signature="")
    return known


def test_those_within_reach_come_nearest_first() -> None:
    assert poles(4.0, 1.0, 30.0, -2.0).within(np.zeros(2), 10.0).tolist() == [1, 3, 0]


def test_a_name_that_is_taken_gets_a_number() -> None:
    assert [each.name for each in poles(0.0, 1.0, 2.0).all] == ["lm", "lm-2", "lm-3"]


def test_a_landmark_is_found_by_its_signature_which_is_its_name() -> None:
    known = poles(0.0)
    known.add("lm", np.ones(2), kind="pole", signature="A7")
    assert (known.signed("A7"), known.signed("B1"), known.all[1].name) == ([1], (), "A7")


def test_more_landmarks_than_there_was_room_for_stay_where_they_are() -> None:
    many = poles(*range(200))
    many.told(150, np.eye(2))
    assert many.point_m[:, 0].tolist() == list(range(200))
    assert many.told_count == 1


def test_one_never_told_of_has_moved_beyond_measure_and_one_told_of_by_sigmas() -> None:
    known = poles(0.0, 5.0)
    known.told(1, 4.0 * np.eye(2))
    known.point_m[1] += (0.0, 3.0)
    assert known.moved_sigmas().tolist() == [np.inf, 1.5]


def test_one_told_of_again_without_a_covariance_keeps_the_one_before() -> None:
    known = poles(0.0)
    known.told(0, 0.25 * np.eye(2))
    known.point_m[0] += 1.0
    again = known.told(0, None)
    assert (again.position_m.tolist(), again.covariance_m2.tolist()) == ([1.0, 1.0], [[0.25, 0.0], [0.0, 0.25]])


def test_only_a_third_less_variance_is_worth_telling() -> None:
    known = poles(0.0)
    known.told(0, np.eye(2))
    assert (known.is_surer(0, 0.8 * np.eye(2)), known.is_surer(0, 0.6 * np.eye(2))) == (False, True)


def test_of_what_saw_a_landmark_only_what_is_new_is_told_and_all_of_it_is_counted() -> None:
    known = poles(0.0)
    see(known, 3, 4)
    first = known.told(0, np.eye(2))
    see(known, 5)
    second = known.told(0, np.eye(2))
    assert [sequence for _, _, sequence in first.observations] == [3, 4]
    assert ([sequence for _, _, sequence in second.observations], second.observation_count) == ([5], 3)


def see(known: LiveLandmarks, *sequences: int) -> None:
    """The first landmark seen in sweeps of these numbers."""
    track = cast(Track, SimpleNamespace(first_ns=0, last_ns=1))
    seen = [cast(Seen, SimpleNamespace(sequence=sequence)) for sequence in sequences]
    known.all[0].take(track, seen, vehicle="veh-a", boot_id="boot-1")

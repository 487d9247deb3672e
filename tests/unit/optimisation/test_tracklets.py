"""Detections become tracks; two things seen at once stay two."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from trigpoint_optimisation.core.tracklets import UNTRACKED, close_pairs, linked_tracks, seen_together
from trigpoint_optimisation.settings import DetectionSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SETTINGS = DetectionSettings()  # gate 1 m, gap 4 s, at least 5 detections
SWEEP_NS = 500_000_000


def seen(places_m: Floats, *, sweeps: int = 20, noise_m: float = 0.1, seed: int = 1) -> tuple[Ints, Floats]:
    """Stamps (d,) and points (d, 2): every place seen in every sweep, in an order that changes from sweep to sweep."""
    rng = np.random.default_rng(seed)
    order = np.concatenate([rng.permutation(len(places_m)) for _ in range(sweeps)])
    stamp_ns = np.repeat(np.arange(sweeps) * SWEEP_NS, len(places_m))
    return stamp_ns, places_m[order] + rng.normal(0.0, noise_m, (len(order), 2))


def linked(stamp_ns: Ints, point_m: Floats) -> Ints:
    return linked_tracks(stamp_ns, point_m, np.ones(len(stamp_ns), dtype=bool), settings=SETTINGS)


def test_a_pair_of_poles_one_and_a_half_metres_apart_stays_two_tracks() -> None:
    stamp_ns, point_m = seen(np.array([[0.0, 0.0], [1.5, 0.0]]))
    track = linked(stamp_ns, point_m)
    left = set(track[point_m[:, 0] < 0.75].tolist())
    right = set(track[point_m[:, 0] > 0.75].tolist())
    assert (len(left), len(right), left & right) == (1, 1, set())


def test_a_thing_unseen_for_longer_than_the_gap_starts_a_new_track() -> None:
    stamp_ns, point_m = seen(np.zeros((1, 2)))
    late_ns = stamp_ns + np.where(np.arange(20) >= 10, 4_100_000_000, 0)
    assert linked(stamp_ns, point_m).tolist() == [0] * 20
    assert linked(late_ns, point_m).tolist() == [0] * 10 + [1] * 10


def test_a_thing_seen_too_seldom_is_no_landmark() -> None:
    stamp_ns, point_m = seen(np.zeros((1, 2)), sweeps=4)
    assert linked(stamp_ns, point_m).tolist() == [UNTRACKED] * 4


def test_clutter_leaves_the_numbers_of_tracks_without_holes() -> None:
    stamp_ns, point_m = seen(np.array([[0.0, 0.0], [30.0, 0.0], [60.0, 0.0]]))
    middle = np.abs(point_m[:, 0] - 30.0) < 5.0
    point_m[middle, 1] += np.arange(middle.sum()) * 10.0  # never twice in the same place
    assert set(linked(stamp_ns, point_m).tolist()) == {UNTRACKED, 0, 1}


def test_an_unusable_detection_is_in_no_track() -> None:
    stamp_ns, point_m = seen(np.zeros((1, 2)))
    usable = np.arange(20) != 7
    track = linked_tracks(stamp_ns, point_m, usable, settings=SETTINGS)
    assert track[7] == UNTRACKED
    assert (track[usable] == 0).all()


def test_no_detection_makes_no_track() -> None:
    assert len(linked(np.zeros(0, dtype=np.int64), np.zeros((0, 2)))) == 0


@settings(deadline=None)
@given(st.integers(2, 8), st.integers(0, 100))
def test_one_sweep_never_gives_a_track_two_detections(count: int, seed: int) -> None:
    places_m = np.random.default_rng(seed).uniform(0.0, 5.0, (count, 2))
    stamp_ns, point_m = seen(places_m, noise_m=0.3, seed=seed)
    track = linked(stamp_ns, point_m)
    used = track >= 0
    pairs = np.column_stack([stamp_ns[used], track[used]])
    assert len(np.unique(pairs, axis=0)) == len(pairs)


def test_tracks_of_one_sweep_are_told_apart_and_others_are_not() -> None:
    track = np.array([0, 1, 2, 0, 2, UNTRACKED, 3])
    stamp_ns = np.array([0, 0, 0, 1, 1, 1, 2])
    assert seen_together(track, stamp_ns) == {(0, 1), (0, 2), (1, 2)}


def test_nothing_seen_is_nothing_apart() -> None:
    assert seen_together(np.full(3, UNTRACKED), np.zeros(3, dtype=np.int64)) == frozenset()


def test_only_mutually_nearest_points_within_the_gate_are_close() -> None:
    point_m = np.array([[0.0, 0.0], [0.4, 0.0], [0.9, 0.0], [50.0, 0.0], [50.2, 0.0], [90.0, 0.0]])
    assert close_pairs(point_m, 1.0).tolist() == [[3, 4], [0, 1]]  # 0.4 to 0.9 is nearer to 0.0


def test_a_single_point_has_no_pair() -> None:
    assert close_pairs(np.zeros((1, 2)), 1.0).shape == (0, 2)

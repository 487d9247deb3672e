"""Tracks of several passes become one landmark where a joint shift says so, and never against what was seen."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from trigpoint_optimisation.core.merging import LandmarkGroups, Tracks, joint_shift_pairs, voted_pairs
from trigpoint_optimisation.settings import DetectionSettings

Floats = NDArray[np.float64]

SETTINGS = DetectionSettings()  # votes reach 9 m, cell 0.75 m, at least 5 votes


def street(count: int = 12, *, seed: int = 1) -> Floats:
    """Poles (n, 2) along 100 m of street, irregularly."""
    rng = np.random.default_rng(seed)
    along = np.sort(rng.uniform(0.0, 100.0, count))
    return np.column_stack([along, rng.choice([-6.0, 6.0], count) + rng.normal(0.0, 1.0, count)])


def two_passes(shift_m: Floats, *, kinds: tuple[int, int] = (0, 0)) -> Tracks:
    """The same street mapped by two drives; the second one's tracks are off by a shift (2,)."""
    first = street()
    second = first + shift_m + np.random.default_rng(9).normal(0.0, 0.1, first.shape)
    count = len(first)
    return Tracks(
        point_m=np.concatenate([first, second]),
        drive=np.repeat([0, 1], count),
        path_m=np.tile(first[:, 0] % 55.0, 2),  # within one 60 m segment
        kind=np.repeat(kinds, count),
        apart=frozenset(),
    )


@pytest.mark.parametrize("off_m", [0.0, 2.5, 4.0, 6.0, 8.0])
def test_a_joint_shift_pairs_every_pole_with_itself(off_m: float) -> None:
    poles = street()
    shifted = poles + off_m * np.array([0.6, 0.8]) + np.random.default_rng(2).normal(0.0, 0.1, poles.shape)
    pairs = joint_shift_pairs(poles, shifted, settings=SETTINGS)
    assert (pairs[:, 0] == pairs[:, 1]).all()
    assert len(pairs) >= 10  # of 12


def test_a_small_turn_of_the_map_is_found_too() -> None:
    poles, turn = street(), np.radians(3.0)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    turned = (poles - poles.mean(axis=0)) @ rotation.T + poles.mean(axis=0) + (2.0, 3.0)
    pairs = joint_shift_pairs(poles, turned, settings=SETTINGS)
    assert (pairs[:, 0] == pairs[:, 1]).all()
    assert len(pairs) >= 10  # of 12


def test_an_evenly_spaced_row_stays_unassigned_rather_than_shifted_by_one() -> None:
    row = np.column_stack([np.arange(15) * 5.0, np.zeros(15)])
    assert len(joint_shift_pairs(row, row + (2.5, 0.0), settings=SETTINGS)) == 0


def test_two_streets_that_have_nothing_in_common_pair_nothing() -> None:
    assert len(joint_shift_pairs(street(seed=1), street(seed=2), settings=SETTINGS)) == 0


def test_too_few_poles_have_no_vote() -> None:
    poles = street(4)
    assert len(joint_shift_pairs(poles, poles, settings=SETTINGS)) == 0


def test_a_pole_is_in_one_pair_at_most() -> None:
    poles = street()
    doubled = np.concatenate([poles, poles + (0.3, 0.0)])
    pairs = joint_shift_pairs(poles, doubled, settings=SETTINGS)
    assert len(np.unique(pairs[:, 0])) == len(np.unique(pairs[:, 1])) == len(pairs)


@pytest.mark.parametrize("off_m", [0.0, 2.5, 4.0, 6.0])
def test_two_passes_are_joined_pole_by_pole(off_m: float) -> None:
    pairs = voted_pairs(two_passes(np.array([off_m, 0.0])), settings=SETTINGS)
    assert len(pairs) >= 10  # of 12
    assert all(b - a == 12 for _, a, b in pairs)


def test_a_pole_and_a_corner_are_never_joined() -> None:
    assert voted_pairs(two_passes(np.zeros(2), kinds=(0, 1)), settings=SETTINGS) == ()


def test_two_tracks_seen_together_are_never_joined() -> None:
    groups = LandmarkGroups(3, [(0, 1)])
    assert not groups.join(0, 1)


def test_nor_are_they_joined_by_way_of_a_third() -> None:
    groups = LandmarkGroups(4, [(0, 3)])
    assert groups.join(0, 1)
    assert groups.join(2, 3)
    assert not groups.join(1, 2)
    assert groups.landmark_of_track().tolist() == [0, 0, 1, 1]


PAIRS = st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)).filter(lambda pair: pair[0] != pair[1]), max_size=20)


@settings(deadline=None)
@given(PAIRS, PAIRS)
def test_no_order_of_joining_brings_together_what_was_seen_apart(
    apart: list[tuple[int, int]], wanted: list[tuple[int, int]]
) -> None:
    groups = LandmarkGroups(10, apart)
    said = [groups.join(a, b) for a, b in wanted]
    landmark = groups.landmark_of_track()
    assert all(landmark[a] != landmark[b] for a, b in apart)
    assert [bool(landmark[a] == landmark[b]) for (a, b), joined in zip(wanted, said, strict=True) if joined] == [
        True
    ] * sum(said)


def test_landmarks_are_numbered_in_order_of_their_first_track() -> None:
    groups = LandmarkGroups(5, [])
    groups.join(4, 1)
    groups.join(3, 2)
    assert groups.landmark_of_track().tolist() == [0, 1, 2, 2, 1]

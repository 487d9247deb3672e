"""One landmark, a new one, or no answer: what a track is, by what is expected of the candidates."""

import numpy as np

from trigpoint_optimisation.core.live_association import Candidate, answer, candidate


def at(landmark: int, chi_square: float, *, sigma_m: float = 0.2, distance_m: float = 0.3) -> Candidate:
    return Candidate(landmark=landmark, chi_square=chi_square, distance_m=distance_m, sigma_m=sigma_m)


def test_a_track_is_of_the_one_landmark_within_its_gate() -> None:
    assert answer({5: [at(1, 2.0), at(2, 60.0, distance_m=4.0)]}).of == {5: 1}


def test_a_track_without_any_candidate_is_a_new_landmark() -> None:
    assert answer({5: []}).new == (5,)


def test_a_track_between_two_landmarks_stays_open() -> None:
    assert answer({5: [at(1, 2.0), at(2, 4.0)]}).open == (5,)


def test_a_landmark_expected_only_within_metres_proves_nothing_alone() -> None:
    assert answer({5: [at(1, 1.0, sigma_m=2.5)]}).open == (5,)


def test_two_tracks_never_become_one_landmark() -> None:
    found = answer({5: [at(1, 2.0)], 6: [at(1, 0.5)]})
    assert (found.of, found.open) == ({6: 1}, (5,))


def test_nothing_new_stands_within_a_metre_of_a_landmark_it_does_not_fit() -> None:
    assert answer({5: [at(1, 40.0, distance_m=0.8)]}).open == (5,)


def test_a_candidate_is_held_against_noise_and_expectation_together() -> None:
    off = candidate(1, np.array([1.0, 0.0]), np.zeros(2), noise=0.5 * np.eye(2), expectation=0.5 * np.eye(2))
    assert off.chi_square == 1.0

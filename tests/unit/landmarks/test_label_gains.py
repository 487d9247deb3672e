"""Where one more anchor would help most, and lines and numbers of which only some are told."""

import numpy as np
import pytest

from map_features.examples import gain
from trigpoint_landmarks.core.label_gains import LabelSigmas, MapGains
from trigpoint_landmarks.core.thinning import spread, thinned

SIGMAS = LabelSigmas(sigma_m=0.1, image_sigma_m=0.35)
IMAGES = {"A": ("tile-1",), "B": ("tile-1", "tile-2"), "C": ()}
# Of `gain`: expected 0.04 I m^2, shared diag(0.1 (row + 1), 0.1) m^4.
KNOWN_M2, NEW_M2 = 0.04 + 0.01, 0.04 + 0.01 + 0.35**2


@pytest.fixture
def gains() -> MapGains:
    return MapGains([gain("", "A", "B", "C"), gain("tile-1", "A", "B", "C"), gain("tile-2", "C", "B")])


def best(gains: MapGains, limit: int, *out: str) -> list[tuple[str, str]]:
    found = gains.best(limit, SIGMAS, images_at=lambda name: IMAGES[name], out=out)
    return [(one.landmark, one.image) for one in found]


def test_a_landmark_is_labelled_in_the_image_where_that_tells_most(gains: MapGains) -> None:
    # in tile-1 B is the second row, as in tile-2; the first of equal ones is taken
    assert best(gains, 3) == [("B", "tile-1"), ("A", "tile-1"), ("C", "")]


def test_so_many_are_told_and_none_that_is_labelled(gains: MapGains) -> None:
    assert best(gains, 1, "B") == [("A", "tile-1")]


def test_in_a_new_image_its_own_sigma_counts_too(gains: MapGains) -> None:
    assert gains.reduction_m2("A", "tile-1", SIGMAS) == pytest.approx(0.2 / KNOWN_M2)
    assert gains.reduction_m2("A", "tile-9", SIGMAS) == pytest.approx(0.2 / NEW_M2)
    assert gains.reduction_m2("Z", "tile-1", SIGMAS) is None


def test_where_the_solve_said_nothing_nothing_is_suggested() -> None:
    silent = MapGains([])
    assert (silent.summed_variance_m2, best(silent, 9), silent.reduction_m2("A", "", SIGMAS)) == (None, [], None)


def test_a_line_keeps_its_shape_within_the_tolerance() -> None:
    along = np.linspace(0.0, 2.0 * np.pi, 10_000)
    found = thinned(100.0 * np.column_stack([np.cos(along), np.sin(along)]), most=2000)
    assert 50 < len(found) < 200
    assert np.abs(np.hypot(*found.T) - 100.0).max() < 1e-6  # m: places of the line itself


def test_a_line_too_long_for_that_gives_up_some_of_it() -> None:
    random = np.random.default_rng(1).normal(size=(3000, 2)).cumsum(axis=0)
    found = thinned(random, most=100)
    assert 2 <= len(found) <= 100
    assert (found[[0, -1]] == random[[0, -1]]).all()


@pytest.mark.parametrize(("count", "most", "expected"), [(3, 5, [0, 1, 2]), (9, 3, [0, 4, 8]), (1, 3, [0])])
def test_numbers_are_spread_from_first_to_last(count: int, most: int, expected: list[int]) -> None:
    assert spread(count, most=most).tolist() == expected

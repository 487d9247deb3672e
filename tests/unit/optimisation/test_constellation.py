"""A place in a map without a first guess: found where it is unique, and refused where it is not."""

import numpy as np

from trigpoint.geodesy.poses import transform_points
from trigpoint_optimisation.core.constellation import Constellation, constellation_match

RNG = np.random.default_rng(7)
MAP_M = RNG.uniform(0.0, 600.0, (450, 2))
KNOWN = Constellation(point_m=MAP_M, kind=("pole",) * len(MAP_M))
T_MAP_LOCAL = np.array([310.0, 280.0, 2.3])


def seen_around(T_map_local: np.ndarray, *, sigma_m: float = 0.1) -> Constellation:
    """What a vehicle sees within 60 m, in its own frame."""
    near = MAP_M[np.hypot(*(MAP_M - T_map_local[:2]).T) < 60.0]
    c, s = np.cos(T_map_local[2]), np.sin(T_map_local[2])
    local = (near - T_map_local[:2]) @ np.array([[c, -s], [s, c]])
    return Constellation(point_m=local + RNG.normal(0.0, sigma_m, local.shape), kind=("pole",) * len(local))


def test_a_constellation_seen_from_anywhere_is_found_within_its_noise() -> None:
    match = constellation_match(seen_around(T_MAP_LOCAL), KNOWN)
    assert match is not None
    assert np.hypot(*(match.T_map_local - T_MAP_LOCAL)[:2]) < 0.15  # m: 0.1 m of noise over some ten landmarks
    assert abs(np.angle(np.exp(1j * (match.T_map_local[2] - T_MAP_LOCAL[2])))) < 0.01


def test_landmarks_that_are_not_in_the_map_have_no_place() -> None:
    strange = Constellation(point_m=RNG.uniform(0.0, 100.0, (14, 2)), kind=("pole",) * 14)
    assert constellation_match(strange, KNOWN) is None


def test_a_row_of_equal_poles_has_no_place_of_its_own() -> None:
    row = np.column_stack([np.arange(40) * 15.0, np.zeros(40)])
    known = Constellation(point_m=row, kind=("pole",) * 40)
    assert constellation_match(Constellation(point_m=row[10:20], kind=("pole",) * 10), known) is None


def test_landmarks_of_another_kind_are_not_the_ones_seen() -> None:
    seen = seen_around(T_MAP_LOCAL)
    corners = Constellation(point_m=seen.point_m, kind=("corner",) * len(seen.kind))
    assert constellation_match(corners, KNOWN) is None


def test_seven_landmarks_are_too_few_to_be_sure() -> None:
    seven = Constellation(point_m=transform_points(T_MAP_LOCAL, MAP_M[:7]), kind=("pole",) * 7)
    assert constellation_match(seven, KNOWN) is None

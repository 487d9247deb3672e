"""Poles and corners of simulated sweeps: all found, nothing else, and as surely as is said."""

import numpy as np
import pytest
from numpy.typing import NDArray

from scanned_worlds.casting import CORNERS_M, SIXTEEN, SIXTY_FOUR, STREET, Sensor, World, swept
from trigpoint_perception.core.perceiving import sights_of
from trigpoint_perception.core.sweep import usable_sweep
from trigpoint_perception.core.tracks import Sight
from trigpoint_perception.settings import PerceptionSettings

SETTINGS = PerceptionSettings()
BOTH = pytest.mark.parametrize("sensor", [SIXTEEN, SIXTY_FOUR], ids=["16 lasers", "64 lasers"])
NO_WALLS = np.zeros((0, 5))


def seen(world: World, sensor: Sensor, kind: str, *, seed: int = 1) -> list[Sight]:
    sweep = usable_sweep(swept(world, sensor, rng=np.random.default_rng(seed)), SETTINGS.sweep)
    return [sight for sight in sights_of(sweep, SETTINGS) if sight.kind == kind]


def nearest_m(sights: list[Sight], truth_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """The distance from each true place to the nearest sight."""
    found = np.array([sight.position_m for sight in sights]).reshape(-1, 2)
    distances: NDArray[np.float64] = np.linalg.norm(truth_m[:, None] - found[None], axis=2).min(axis=1, initial=np.inf)
    return distances


@BOTH
def test_every_pole_is_found_and_nothing_else(sensor: Sensor) -> None:
    poles = seen(STREET, sensor, "pole")
    assert len(poles) == len(STREET.pole_m)
    assert nearest_m(poles, STREET.pole_m).max() < 0.06  # three times the sensor's noise


@BOTH
def test_every_corner_is_found_and_nothing_else(sensor: Sensor) -> None:
    corners = seen(STREET, sensor, "corner")
    assert len(corners) == len(CORNERS_M)
    assert nearest_m(corners, CORNERS_M).max() < 0.1  # the last column's gap to the edge, at 14 m


def test_a_corner_far_away_is_found() -> None:
    away = np.array([[46.0, 0.0, 55.0, 9.0, 8.0], [46.0, 0.0, 55.0, -9.0, 8.0]])  # four rings hit it
    corners = seen(World(cylinders=np.zeros((0, 4)), walls=away), SIXTEEN, "corner")
    assert nearest_m(corners, away[:1, :2]).max() < 0.2  # a column is 0.16 m wide there
    assert len(corners) == 1


@BOTH
def test_a_radius_is_measured(sensor: Sensor) -> None:
    (pole,) = seen(World(cylinders=np.array([[8.0, 2.0, 0.25, 6.0]]), walls=NO_WALLS), sensor, "pole")
    assert pole.diameter_m == pytest.approx(0.5, abs=0.06)  # two columns' spacing there


def test_covariances_hold_what_they_promise() -> None:
    errors, covariances = [], []
    for seed in range(30):
        for sight in seen(STREET, SIXTEEN, "pole", seed=seed):
            row = np.linalg.norm(STREET.pole_m - sight.position_m, axis=1).argmin()
            errors.append(sight.position_m - STREET.pole_m[row])
            covariances.append(sight.covariance_m2)
    error, covariance = np.array(errors), np.array(covariances)
    nees = np.einsum("ij,ijk,ik->i", error, np.linalg.inv(covariance), error)
    assert 0.05 < nees.mean() < 2.0  # two degrees of freedom; shared errors are allowed for, which white noise has not
    assert np.quantile(nees, 0.95) < 5.99


def test_a_pole_half_hidden_by_another_one_is_not_misplaced() -> None:
    world = World(cylinders=np.array([[6.0, 0.0, 0.1, 5.0], [12.0, 0.14, 0.1, 5.0]]), walls=NO_WALLS)
    poles = seen(world, SIXTEEN, "pole")
    found = np.array([pole.position_m for pole in poles])
    assert np.linalg.norm(world.pole_m[:, None] - found[None], axis=2).min(axis=0).max() < 0.1


def test_what_ends_at_a_persons_height_is_no_pole() -> None:
    behind = np.array([[-30.0, 20.0, 30.0, 20.0, 15.0]])  # what shows that the sensor would have seen more of them
    world = World(cylinders=np.array([[7.0, 1.0, 0.25, 1.75], [-6.0, 3.0, 0.2, 1.6]]), walls=behind)
    assert seen(world, SIXTEEN, "pole") == []


def test_a_car_has_no_corner() -> None:
    sides = [[6.0, 2.0, 10.0, 2.0, 1.5], [6.0, 2.0, 6.0, 3.8, 1.5]]
    assert seen(World(cylinders=np.zeros((0, 4)), walls=np.array(sides)), SIXTEEN, "corner") == []


def test_walls_that_meet_flat_have_no_corner() -> None:
    bend = np.array([[-15.0, 10.0, 0.0, 10.0, 6.0], [0.0, 10.0, 13.0, 13.0, 6.0]])
    assert seen(World(cylinders=np.zeros((0, 4)), walls=bend), SIXTEEN, "corner") == []


def test_a_sensor_that_numbers_no_rings_is_searched_all_the_same() -> None:
    scanned = swept(STREET, SIXTY_FOUR)
    scanned.ring[:] = 0
    sights = sights_of(usable_sweep(scanned, SETTINGS.sweep), SETTINGS)
    assert nearest_m([sight for sight in sights if sight.kind == "pole"], STREET.pole_m).max() < 0.06

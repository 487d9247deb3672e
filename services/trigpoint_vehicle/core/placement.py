"""Poles and building corners placed beside the streets."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trigpoint.errors import InputError
from trigpoint_vehicle.core.campus_settings import LandmarkSettings
from trigpoint_vehicle.core.streets import Streets

Floats = NDArray[np.float64]

PAIRS_APART_M = 10.0  # one pair from another, so that each second pole has one partner only
PAIR_DIRECTIONS = 16  # tried around each pole for a second one
CANDIDATES_FACTOR = 12  # candidates drawn for each landmark wanted; most fall to spacing or clearance


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedLandmarks:
    """position_m (n, 2) in grid metres from the campus's corner; diameter_m (n,), NaN for corners."""

    name: tuple[str, ...]
    kind: tuple[str, ...]
    position_m: Floats
    diameter_m: Floats


def candidates_beside_streets_m(
    streets: Streets,
    setback_m: tuple[float, float],
    settings: LandmarkSettings,
    *,
    count: int,
    rng: np.random.Generator,
) -> Floats:
    """Places (count, 2) drawn at random along all streets, so far to either side of their middle."""
    weight = streets.length_m * np.where(streets.in_quadrangle, settings.quadrangle_weight, 1.0)
    street = streets.street[rng.choice(len(weight), size=count, p=weight / weight.sum())]
    begin_m, end_m = streets.junction_m[street[:, 0]], streets.junction_m[street[:, 1]]
    along = (end_m - begin_m) / np.linalg.norm(end_m - begin_m, axis=1, keepdims=True)
    left = np.column_stack([-along[:, 1], along[:, 0]])
    side_m = rng.uniform(*setback_m, count) * rng.choice([-1.0, 1.0], count)
    drawn: Floats = begin_m + rng.uniform(0.0, 1.0, (count, 1)) * (end_m - begin_m) + side_m[:, None] * left
    return drawn


def street_distance_m(streets: Streets, point_m: Floats) -> Floats:
    """How far points (n, 2) are from the nearest street's middle."""
    begin_m = streets.junction_m[streets.street[:, 0]][None]
    span_m = streets.junction_m[streets.street[:, 1]][None] - begin_m
    offset_m = point_m[:, None, :] - begin_m
    share = np.clip((offset_m * span_m).sum(-1) / (span_m**2).sum(-1), 0.0, 1.0)
    nearest: Floats = np.linalg.norm(offset_m - share[..., None] * span_m, axis=-1).min(axis=1)
    return nearest


def _spaced(candidate_m: Floats, taken_m: list[Floats], *, count: int, spacing_m: float) -> list[Floats]:
    chosen: list[Floats] = []
    for point in candidate_m:
        if len(chosen) == count:
            break
        others = np.array(taken_m + chosen)
        if len(others) == 0 or np.hypot(*(others - point).T).min() >= spacing_m:
            chosen.append(point)
    if len(chosen) < count:
        raise InputError(f"only {len(chosen)} of {count} landmarks fit {spacing_m} m apart beside the streets")
    return chosen


@dataclass(frozen=True, slots=True)
class _Ground:
    streets: Streets
    driven: cKDTree
    settings: LandmarkSettings

    def clear_of_traffic(self, point_m: Floats) -> Floats:
        off_street = street_distance_m(self.streets, point_m) >= self.settings.street_clearance_m
        off_track = self.driven.query(point_m)[0] >= self.settings.driven_clearance_m
        clear: Floats = point_m[off_street & off_track]
        return clear


def _poles_m(ground: _Ground, rng: np.random.Generator) -> list[Floats]:
    streets, settings = ground.streets, ground.settings
    setback_m = (settings.pole_setback_min_m, settings.pole_setback_max_m)
    single = settings.pole_count - settings.pair_count
    drawn = candidates_beside_streets_m(streets, setback_m, settings, count=CANDIDATES_FACTOR * max(single, 1), rng=rng)
    poles = _spaced(ground.clear_of_traffic(drawn), [], count=single, spacing_m=settings.spacing_min_m)
    turn = rng.uniform(0.0, 2.0 * np.pi, (len(poles), PAIR_DIRECTIONS))
    ring = settings.pair_distance_m * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    beside = (np.array(poles)[:, None, :] + ring).reshape(-1, 2) if poles else np.empty((0, 2))
    clear = rng.permutation(ground.clear_of_traffic(beside)) if len(beside) else beside
    # a second pole may stand closer than the spacing to its own partner only
    tree = cKDTree(np.array(poles)) if poles else None
    lonely = [point for point in clear if tree is not None and _only_one_near(tree, point, settings)]
    return poles + _spaced(np.array(lonely).reshape(-1, 2), [], count=settings.pair_count, spacing_m=PAIRS_APART_M)


def _only_one_near(tree: cKDTree, point_m: Floats, settings: LandmarkSettings) -> bool:
    return len(tree.query_ball_point(point_m, settings.spacing_min_m)) == 1


def placed_landmarks(
    streets: Streets, driven_m: Floats, settings: LandmarkSettings, rng: np.random.Generator
) -> PlacedLandmarks:
    """Poles and corners clear of every street and of all points driven over (n, 2). Raises InputError if so many do
    not fit."""
    ground = _Ground(streets, cKDTree(driven_m), settings)
    poles = _poles_m(ground, rng)
    setback_m = (settings.corner_setback_min_m, settings.corner_setback_max_m)
    drawn = candidates_beside_streets_m(
        streets, setback_m, settings, count=CANDIDATES_FACTOR * max(settings.corner_count, 1), rng=rng
    )
    clear = ground.clear_of_traffic(drawn)
    corners = _spaced(clear, poles, count=settings.corner_count, spacing_m=settings.spacing_min_m)
    diameter_m = rng.uniform(settings.pole_diameter_min_m, settings.pole_diameter_max_m, len(poles))
    return PlacedLandmarks(
        name=tuple(
            [f"pole-{number:03d}" for number in range(len(poles))]
            + [f"corner-{number:03d}" for number in range(len(corners))]
        ),
        kind=("pole",) * len(poles) + ("corner",) * len(corners),
        position_m=np.array(poles + corners).reshape(-1, 2),
        diameter_m=np.concatenate([diameter_m, np.full(len(corners), np.nan)]),
    )

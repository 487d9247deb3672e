"""Poles with their heights and signs, and trees."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint_vehicle.core.campus_settings import LandmarkSettings
from trigpoint_vehicle.core.lidar_settings import FurnitureSettings
from trigpoint_vehicle.core.placement import PlacedLandmarks, candidates_beside_streets_m
from trigpoint_vehicle.core.scene.buildings import away_from_street, is_inside
from trigpoint_vehicle.core.scene.free_ground import FreeGround, is_apart, spread_out

Floats = NDArray[np.float64]

CANDIDATES_FACTOR = 12  # trees drawn for each one wanted
TREE_STREET_M, TREE_DRIVEN_M, TREE_BUILDING_M = 5.0, 2.5, 1.5  # a trunk's clearance
SIGN_TURN_RAD = 0.15  # 1-sigma of a plate's turn from square to its street
ABOVE_SIGN_M = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Poles:
    """Pole landmarks (n,): place_m (n, 2), radius and height; of a sign's plate width (NaN without) and the direction
    it faces, in rad."""

    name: tuple[str, ...]
    place_m: Floats
    radius_m: Floats
    height_m: Floats
    sign_width_m: Floats
    sign_facing_rad: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Trees:
    """Trees (n,): place_m (n, 2), the trunk's radius, the crown's bottom, radius and half height above the ground."""

    place_m: Floats
    trunk_radius_m: Floats
    crown_bottom_m: Floats
    crown_radius_m: Floats
    crown_half_height_m: Floats


def erected_poles(
    landmarks: PlacedLandmarks, free: FreeGround, settings: FurnitureSettings, rng: np.random.Generator
) -> Poles:
    """Heights and signs of all pole landmarks; a plate faces along the street, for those who drive there."""
    count = landmarks.kind.count("pole")
    place_m = landmarks.position_m[:count]
    has_sign = rng.uniform(size=count) < settings.sign_share
    height_m = rng.uniform(settings.pole_height_min_m, settings.pole_height_max_m, count)
    width_m = rng.uniform(settings.sign_width_min_m, settings.sign_width_max_m, count)
    away = np.array([away_from_street(free.streets, one) for one in place_m]).reshape(-1, 2)
    turn_rad = rng.normal(0.0, SIGN_TURN_RAD, count) + np.pi / 2.0 * rng.choice([-1.0, 1.0], count)
    sign_top_m = settings.sign_bottom_m + settings.sign_height_m + ABOVE_SIGN_M
    return Poles(
        name=landmarks.name[:count],
        place_m=place_m,
        radius_m=landmarks.diameter_m[:count] / 2.0,
        height_m=np.where(has_sign, sign_top_m, height_m),
        sign_width_m=np.where(has_sign, width_m, np.nan),
        sign_facing_rad=np.arctan2(away[:, 1], away[:, 0]) + turn_rad,
    )


def planted_trees(
    landmark_m: Floats,
    footprint: Floats,
    free: FreeGround,
    settings: FurnitureSettings,
    *,
    weights: LandmarkSettings,
    rng: np.random.Generator,
) -> Trees:
    """Trees beside the streets, clear of landmarks (k, 2) and buildings (b, 4, 2), up to as many as are wanted."""
    setback_m = (settings.tree_setback_min_m, settings.tree_setback_max_m)
    count = CANDIDATES_FACTOR * settings.tree_count
    drawn = candidates_beside_streets_m(free.streets, setback_m, weights, count=count, rng=rng)
    clear = free.is_clear(drawn, street_m=TREE_STREET_M, driven_m=TREE_DRIVEN_M)
    clear &= is_apart(drawn, landmark_m, settings.tree_clearance_m)
    for one in footprint:
        clear &= ~is_inside(one, drawn, TREE_BUILDING_M)
    drawn = drawn[clear]
    place_m = drawn[spread_out(drawn, count=settings.tree_count, distance_m=settings.tree_clearance_m)]
    number = len(place_m)
    return Trees(
        place_m=place_m,
        trunk_radius_m=rng.uniform(settings.trunk_radius_min_m, settings.trunk_radius_max_m, number),
        crown_bottom_m=rng.uniform(settings.crown_bottom_min_m, settings.crown_bottom_max_m, number),
        crown_radius_m=rng.uniform(settings.crown_radius_min_m, settings.crown_radius_max_m, number),
        crown_half_height_m=rng.uniform(settings.crown_half_height_min_m, settings.crown_half_height_max_m, number),
    )

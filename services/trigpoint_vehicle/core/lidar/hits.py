"""Where a ray meets a solid or the ground, in closed form; a ray is (x, y, z, dx, dy, dz) with a direction of length 1.

A hit is (distance in m, cosine of the angle of incidence); no hit is (inf, 0).
"""

import math

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint_vehicle.core.scene.ground import (
    GRASS,
    KERB,
    KERB_M,
    KERB_WIDTH_M,
    Ground,
    beside_street,
    kerb_m,
    material_of,
    terrain,
)

Ints = NDArray[np.int64]
Ray = tuple[float, float, float, float, float, float]
Hit = tuple[float, float]
Foot = tuple[float, float, float]

NEAREST_M = 0.05  # what is closer is the sensor's own housing
LEAF_FREE_PATH_M = 1.1  # mean length a ray goes into a crown before a leaf stops it
LEAF_COSINE = 0.6  # leaves face every way
KERB_COSINE = 0.7  # a kerb's face is rounded
GROUND_REACH_M = 75.0  # no ground sends light back from further away: it is met too flat
CLOSE_M, ROUNDS = 1e-4, 6  # when a search along a ray ends
DESCENT_LEAST = 1e-3  # a ray that falls less towards the ground never reaches it within that


@compiled
def cylinder_hit(ray: Ray, foot: Foot, radius_m: float, height_m: float) -> Hit:
    """The first hit of an upright cylinder's side or top."""
    off_x, off_y = ray[0] - foot[0], ray[1] - foot[1]
    square = ray[3] * ray[3] + ray[4] * ray[4]
    along = off_x * ray[3] + off_y * ray[4]
    rest = along * along - square * (off_x * off_x + off_y * off_y - radius_m * radius_m)
    if rest <= 0.0:
        return math.inf, 0.0
    root = math.sqrt(rest)
    enter, leave = (-along - root) / square, (-along + root) / square
    if enter < NEAREST_M:
        return math.inf, 0.0
    z = ray[2] + enter * ray[5] - foot[2]
    if 0.0 <= z <= height_m:
        return enter, root / radius_m
    if z > height_m and ray[5] < 0.0:
        top = (foot[2] + height_m - ray[2]) / ray[5]
        if top <= leave:
            return top, -ray[5]
    return math.inf, 0.0


@compiled
def _slab(at: float, towards: float, low: float, high: float) -> tuple[float, float]:
    if abs(towards) < 1e-12:
        return (-math.inf, math.inf) if low <= at <= high else (math.inf, -math.inf)
    first, second = (low - at) / towards, (high - at) / towards
    return (first, second) if first < second else (second, first)


@compiled
def box_hit(ray: Ray, foot: Foot, facing: tuple[float, float], size: Foot) -> Hit:
    """The first hit of an upright box; size: half lengths along and across its facing, and height (slab method)."""
    off_x, off_y = ray[0] - foot[0], ray[1] - foot[1]
    ahead, left = ray[3] * facing[0] + ray[4] * facing[1], ray[4] * facing[0] - ray[3] * facing[1]
    x, y = off_x * facing[0] + off_y * facing[1], off_y * facing[0] - off_x * facing[1]
    enter_x, leave_x = _slab(x, ahead, -size[0], size[0])
    enter_y, leave_y = _slab(y, left, -size[1], size[1])
    enter_z, leave_z = _slab(ray[2] - foot[2], ray[5], 0.0, size[2])
    enter, leave = max(enter_x, enter_y, enter_z), min(leave_x, leave_y, leave_z)
    if enter > leave or enter < NEAREST_M:
        return math.inf, 0.0
    if enter == enter_x:
        return enter, abs(ahead)
    return enter, abs(left) if enter == enter_y else abs(ray[5])


@compiled
def crown_hit(ray: Ray, foot: Foot, size: Foot, chance: float) -> Hit:
    """The leaf a ray ends at in a crown, an upright ellipsoid of leaves spread evenly; `chance` in [0, 1) says after
    how much of the way it is stopped (Beer and Lambert's law); no hit for a ray that gets through."""
    half_m = size[2] / 2.0
    off_x, off_y = (ray[0] - foot[0]) / size[0], (ray[1] - foot[1]) / size[0]
    off_z = (ray[2] - foot[2] - half_m) / half_m
    to_x, to_y, to_z = ray[3] / size[0], ray[4] / size[0], ray[5] / half_m
    square = to_x * to_x + to_y * to_y + to_z * to_z
    along = off_x * to_x + off_y * to_y + off_z * to_z
    rest = along * along - square * (off_x * off_x + off_y * off_y + off_z * off_z - 1.0)
    if rest <= 0.0:
        return math.inf, 0.0
    root = math.sqrt(rest)
    enter, leave = max((-along - root) / square, NEAREST_M), (-along + root) / square
    stopped = enter - LEAF_FREE_PATH_M * math.log(1.0 - chance)
    return (stopped, LEAF_COSINE) if stopped < leave else (math.inf, 0.0)


@compiled
def _terrain_hit(ground: Ground, ray: Ray) -> tuple[float, float]:
    # distance and how fast the ray falls towards the carriageways' level there (Newton's method)
    steepest = 0.0
    for number in range(len(ground.wave)):
        steepest += ground.wave[number, 4]
    if ray[5] > steepest:
        return math.inf, 0.0
    reach, step, rounds, descent = 0.0, math.inf, 0, 0.0
    while abs(step) > CLOSE_M and rounds < ROUNDS:
        height, east, north = terrain(ground.wave, ray[0] + reach * ray[3], ray[1] + reach * ray[4])
        descent = east * ray[3] + north * ray[4] - ray[5]
        if descent < DESCENT_LEAST:
            return math.inf, 0.0
        step = (ray[2] + reach * ray[5] - height) / descent
        reach, rounds = min(max(reach + step, 0.0), 2.0 * GROUND_REACH_M), rounds + 1
    return (reach, descent) if NEAREST_M < reach < GROUND_REACH_M else (math.inf, 0.0)


@compiled
def _verge_reach(ground: Ground, near: Ints, ray: Ray, level: Hit) -> float:
    # how far the ray is when it comes down to a kerb's height over the carriageways' level
    reach, step, rounds = max(level[0] - KERB_M / level[1], 0.0), math.inf, 0
    while abs(step) > CLOSE_M and rounds < ROUNDS:
        x, y = ray[0] + reach * ray[3], ray[1] + reach * ray[4]
        _, junction_m = beside_street(ground.street, near, x, y)
        step = (ray[2] + reach * ray[5] - terrain(ground.wave, x, y)[0] - kerb_m(junction_m)) / level[1]
        reach, rounds = reach + step, rounds + 1
    return reach


@compiled
def _kerb_face(ground: Ground, near: Ints, ray: Ray, verge: float, level: float) -> float:
    # between a place on the carriageway and one that is not, by halves
    on, off = verge, level
    for _ in range(12):
        middle = 0.5 * (on + off)
        beyond_m, _ = beside_street(ground.street, near, ray[0] + middle * ray[3], ray[1] + middle * ray[4])
        on, off = (middle, off) if beyond_m <= 0.0 else (on, middle)
    return 0.5 * (on + off)


@compiled
def ground_hit(ground: Ground, near: Ints, ray: Ray) -> tuple[float, float, int]:
    """The first hit of the ground, with its material: carriageway, marking, kerb or verge."""
    level = _terrain_hit(ground, ray)
    if level[0] == math.inf:
        return math.inf, 0.0, 0
    verge = _verge_reach(ground, near, ray, level)
    x, y = ray[0] + verge * ray[3], ray[1] + verge * ray[4]
    beyond_m, _ = beside_street(ground.street, near, x, y)
    if beyond_m > 0.0:
        return verge, level[1], KERB if beyond_m < KERB_WIDTH_M else GRASS
    x, y = ray[0] + level[0] * ray[3], ray[1] + level[0] * ray[4]
    beyond_m, junction_m = beside_street(ground.street, near, x, y)
    if beyond_m > 0.0 and kerb_m(junction_m) > 0.0:
        return _kerb_face(ground, near, ray, verge, level[0]), KERB_COSINE, KERB
    return level[0], level[1], material_of(ground, near, x, y)

"""Where a beam meets a solid or the ground, in closed form; its middle is a ray (x, y, z, dx, dy, dz) with a direction
of length 1.

A beam is evenly lit over its width, `divergence_rad` times the distance, level and across the ray; it has no height. A
hit is (range in m, cosine of incidence summed over what of the beam is stopped, share of the beam that is); no hit is
(inf, 0, 0). Echoes from within one hit are closer together than a pulse is long (5 ns are 0.75 m there and back), so
its range is their mean, each weighted by what it returns (Wagner et al. 2006, the sum of a footprint's echoes).
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
Hit = tuple[float, float, float]
Foot = tuple[float, float, float]

NEAREST_M = 0.05  # what is closer is the sensor's own housing
LEAF_FREE_PATH_M = 1.1  # mean length a ray goes into a crown before a leaf stops it
LEAF_COSINE = 0.6  # leaves face every way
KERB_COSINE = 0.7  # a kerb's face is rounded
GROUND_REACH_M = 75.0  # no ground sends light back from further away: it is met too flat
NO_HIT = (math.inf, 0.0, 0.0)
NARROW = 1e-6  # of a cylinder's radius: what is lit is as good as a line
CLOSE_M, ROUNDS = 1e-4, 6  # when a search along a ray ends
DESCENT_LEAST = 1e-3  # a ray that falls less towards the ground never reaches it within that


@compiled
def _lit_strip(low: float, high: float) -> tuple[float, float]:
    # of a cylinder's front between two offsets from its axis: the cosine of incidence summed over them, and the mean
    # depth before the axis weighted by it; all in radii
    if high - low < NARROW:
        cosine = math.sqrt(max(1.0 - 0.25 * (low + high) * (low + high), 0.0))
        return cosine * (high - low), cosine
    cosines = 0.5 * (high * math.sqrt(1.0 - high * high) + math.asin(high))
    cosines -= 0.5 * (low * math.sqrt(1.0 - low * low) + math.asin(low))
    return cosines, (high - low - (high * high * high - low * low * low) / 3.0) / cosines


@compiled
def cylinder_hit(ray: Ray, foot: Foot, radius_m: float, height_m: float, divergence_rad: float) -> Hit:
    """The first hit of an upright cylinder's side or top; a beam that only grazes it ends beside its axis."""
    off_x, off_y = ray[0] - foot[0], ray[1] - foot[1]
    level = math.sqrt(ray[3] * ray[3] + ray[4] * ray[4])
    along, side = -(off_x * ray[3] + off_y * ray[4]) / level, (ray[3] * off_y - ray[4] * off_x) / level
    half = 0.5 * divergence_rad * along / level
    if along < NEAREST_M or abs(side) >= radius_m + half:
        return NO_HIT
    low, high = max((side - half) / radius_m, -1.0), min((side + half) / radius_m, 1.0)
    cosines, depth = _lit_strip(low, high)
    share, cosine = 1.0, depth
    if half > 0.0:
        share, cosine = min((high - low) * radius_m / (2.0 * half), 1.0), cosines * radius_m / (2.0 * half)
    enter = (along - depth * radius_m) / level
    if enter < NEAREST_M:
        return NO_HIT
    z = ray[2] + enter * ray[5] - foot[2]
    if 0.0 <= z <= height_m:
        return enter, level * cosine, share
    if z > height_m and ray[5] < 0.0:
        top = (foot[2] + height_m - ray[2]) / ray[5]
        if top * level <= along + depth * radius_m:
            return top, -ray[5] * share, share
    return NO_HIT


@compiled
def _slab(at: float, towards: float, low: float, high: float) -> tuple[float, float]:
    if abs(towards) < 1e-12:
        return (-math.inf, math.inf) if low <= at <= high else (math.inf, -math.inf)
    first, second = (low - at) / towards, (high - at) / towards
    return (first, second) if first < second else (second, first)


@compiled
def _lit_side(at: tuple[float, float], aim: tuple[float, float], size: Foot, spread: float) -> tuple[float, float]:
    # of a box seen from `at` along `aim` (both in its axes, aim of length 1): the middle of what of the beam's width
    # lies on it, to the left of the ray, and the share; spread: half a width per distance
    middle, reach = aim[1] * at[0] - aim[0] * at[1], size[0] * abs(aim[1]) + size[1] * abs(aim[0])
    turned = math.copysign(1.0, middle)
    edge_x, edge_y = math.copysign(size[0], turned * aim[1]), -math.copysign(size[1], turned * aim[0])
    half = max(spread * (aim[0] * (edge_x - at[0]) + aim[1] * (edge_y - at[1])), 0.0)
    low, high = max(middle - reach, -half), min(middle + reach, half)
    if low > high:
        return 0.0, 0.0
    return 0.5 * (low + high), (high - low) / (2.0 * half) if half > 0.0 else 1.0


@compiled
def box_hit(ray: Ray, foot: Foot, facing: tuple[float, float], size: Foot, divergence_rad: float) -> Hit:
    """The first hit of an upright box; size: half lengths along and across its facing, and height (slab method, on the
    middle of what of the beam lies between the box's outermost edges)."""
    off_x, off_y = ray[0] - foot[0], ray[1] - foot[1]
    level = math.sqrt(ray[3] * ray[3] + ray[4] * ray[4])
    ahead, left = ray[3] * facing[0] + ray[4] * facing[1], ray[4] * facing[0] - ray[3] * facing[1]
    x, y = off_x * facing[0] + off_y * facing[1], off_y * facing[0] - off_x * facing[1]
    aside, share = _lit_side((x, y), (ahead / level, left / level), size, 0.5 * divergence_rad / level)
    if share == 0.0:
        return NO_HIT
    x, y = x - aside * left / level, y + aside * ahead / level
    enter_x, leave_x = _slab(x, ahead, -size[0], size[0])
    enter_y, leave_y = _slab(y, left, -size[1], size[1])
    enter_z, leave_z = _slab(ray[2] - foot[2], ray[5], 0.0, size[2])
    enter, leave = max(enter_x, enter_y, enter_z), min(leave_x, leave_y, leave_z)
    if enter > leave or enter < NEAREST_M:
        return NO_HIT
    if enter == enter_x:
        return enter, abs(ahead) * share, share
    return enter, share * (abs(left) if enter == enter_y else abs(ray[5])), share


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
        return NO_HIT
    root = math.sqrt(rest)
    enter, leave = max((-along - root) / square, NEAREST_M), (-along + root) / square
    stopped = enter - LEAF_FREE_PATH_M * math.log(1.0 - chance)
    return (stopped, LEAF_COSINE, 1.0) if stopped < leave else NO_HIT


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
def _verge_reach(ground: Ground, near: Ints, ray: Ray, level: tuple[float, float]) -> float:
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

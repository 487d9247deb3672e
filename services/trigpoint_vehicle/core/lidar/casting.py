"""Sweeps of a lidar cast into the world: every beam's strongest return, from the pose the sensor had at that time."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint_vehicle.core.lidar.hits import (
    GROUND_REACH_M,
    Foot,
    Hit,
    Ray,
    box_hit,
    crown_hit,
    cylinder_hit,
    ground_hit,
)
from trigpoint_vehicle.core.lidar.solids import CROWN, CYLINDER, Solids
from trigpoint_vehicle.core.scene.ground import Ground, streets_near, terrain

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Float32s = NDArray[np.float32]

OFF_LEVEL_RAD = 0.02  # by which a tilted sensor's beams leave their column's azimuth at most: tan 15 deg x 4 deg
SENSOR_MOVES_M = 2.0  # in half a sweep, at most, together with what it looks at
GOLDEN = np.uint64(0x9E3779B97F4A7C15)
FIRST_MIX, SECOND_MIX = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
DRAWS_A_RAY, LEAF_DRAW = 8, 7
NO_SOLID = -1
WHOLE = 1.0 - 1e-9  # share of a beam: all of it


class Optics(NamedTuple):
    """What a sensor is: direction (c, b, 3) of each shot and azimuth (c,) of each column, in the sensor's frame;
    column_s (c,) after the sweep's begin; position (3,) and rotation (3, 3) in the base frame; limits of range in m,
    range noise in m, divergence in rad, least return, scatter of return and intensity, and dropout."""

    direction: Floats
    azimuth: Floats
    column_s: Floats
    position: Floats
    rotation: Floats
    range_min_m: float
    range_max_m: float
    range_sigma_m: float
    divergence_rad: float
    return_limit: float
    return_scatter: float
    intensity_scatter: float
    dropout: float


class World(NamedTuple):
    """What is looked at, and its reflectivity and intensity (m,) by material."""

    ground: Ground
    solids: Solids
    reflectivity: Floats
    intensity: Floats


class Taken(NamedTuple):
    """What came back from shots (s, r), or of one sweep (r,): range in m (NaN for nothing), intensity, material, number
    of the solid or NO_SOLID."""

    range_m: Float32s
    intensity: Float32s
    material: NDArray[np.uint8]
    solid: NDArray[np.int32]


class _Nearest(NamedTuple):
    # of each beam so far the nearest that stops all of it (s, 0) and the nearest that stops a part (s, 1; further parts
    # are left out): range in m, cosine of incidence summed over the part, the part's share, solid
    range_m: Floats
    cosine: Floats
    share: Floats
    solid: Ints


class _Turning(NamedTuple):
    # of each column: the sensor's place (c, 3), its axes in the world (c, 3, 3), the azimuth it looks to (c,)
    place: Floats
    axes: Floats
    azimuth: Floats


class _Placed(NamedTuple):
    # feet (n, 3), facings (n, 2) and velocities (n, 2) of all solids at the sweep's begin
    foot: Floats
    facing: Floats
    velocity: Floats


class _View(NamedTuple):
    world: World
    optics: Optics
    turning: _Turning
    here: _Placed
    seed: np.uint64


@compiled
def uniform(seed: np.uint64, number: int) -> float:
    """A number in [0, 1) that depends on its two arguments alone (Steele et al. 2014, SplitMix64)."""
    mixed = seed + (np.uint64(number) + np.uint64(1)) * GOLDEN
    mixed = (mixed ^ (mixed >> np.uint64(30))) * FIRST_MIX
    mixed = (mixed ^ (mixed >> np.uint64(27))) * SECOND_MIX
    return float((mixed ^ (mixed >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53


@compiled
def _normals(seed: np.uint64, number: int) -> tuple[float, float]:
    # two standard normal numbers (Box and Muller 1958)
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(seed, number)))
    angle = 2.0 * math.pi * uniform(seed, number + 1)
    return radius * math.cos(angle), radius * math.sin(angle)


@compiled
def _sensor_at(wave: Floats, optics: Optics, base: Floats, place: Floats, axes: Floats) -> None:
    # base: x, y in m, heading in rad; it stands on the carriageways' level with its z along the normal
    height, east, north = terrain(wave, base[0], base[1])
    ahead_x, ahead_y = math.cos(base[2]), math.sin(base[2])
    rise = east * ahead_x + north * ahead_y
    length, upright = math.sqrt(1.0 + rise * rise), math.sqrt(1.0 + east * east + north * north)
    ahead = (ahead_x / length, ahead_y / length, rise / length)
    up = (-east / upright, -north / upright, 1.0 / upright)
    left = (
        up[1] * ahead[2] - up[2] * ahead[1],
        up[2] * ahead[0] - up[0] * ahead[2],
        up[0] * ahead[1] - up[1] * ahead[0],
    )
    foot = (base[0], base[1], height)
    for row in range(3):
        place[row] = foot[row]
        base_row = (ahead[row], left[row], up[row])
        for inner in range(3):
            place[row] += base_row[inner] * optics.position[inner]
        for column in range(3):
            axes[row, column] = 0.0
            for inner in range(3):
                axes[row, column] += base_row[inner] * optics.rotation[inner, column]


@compiled
def sensor_poses(wave: Floats, optics: Optics, base: Floats) -> tuple[Floats, Floats]:
    """Places (n, 3) and axes (n, 3, 3) of the sensor in the world, from base poses (n, 3): x, y in m over the ground,
    heading in rad."""
    place, axes = np.empty((len(base), 3)), np.empty((len(base), 3, 3))
    for number in range(len(base)):
        _sensor_at(wave, optics, base[number], place[number], axes[number])
    return place, axes


@compiled
def _ray(turning: _Turning, optics: Optics, column: int, beam: int) -> Ray:
    place, axes, aim = turning.place[column], turning.axes[column], optics.direction[column, beam]
    return (
        place[0],
        place[1],
        place[2],
        axes[0, 0] * aim[0] + axes[0, 1] * aim[1] + axes[0, 2] * aim[2],
        axes[1, 0] * aim[0] + axes[1, 1] * aim[1] + axes[1, 2] * aim[2],
        axes[2, 0] * aim[0] + axes[2, 1] * aim[1] + axes[2, 2] * aim[2],
    )


@compiled
def _placed(solids: Solids, movers: Floats) -> _Placed:
    foot, facing, velocity = solids.centre.copy(), solids.facing.copy(), np.zeros((len(solids.shape), 2))
    for number in range(len(solids.shape)):
        mover = solids.mover[number]
        if mover >= 0:
            speed = max(math.hypot(movers[mover, 3], movers[mover, 4]), 1e-9)
            for axis in range(3):
                foot[number, axis] += movers[mover, axis]
            for axis in range(2):
                velocity[number, axis] = movers[mover, 3 + axis]
                facing[number, axis] = movers[mover, 3 + axis] / speed
    return _Placed(foot, facing, velocity)


@compiled
def _columns(view: _View, foot: Floats, reach_m: float) -> tuple[float, float, float]:
    # the azimuth a solid is seen at from the middle of the sweep, half of what it fills, and the azimuth of a column;
    # half below 0 for one out of range
    turning, optics = view.turning, view.optics
    middle = turning.place[len(turning.place) // 2]
    away_x, away_y = foot[0] - middle[0], foot[1] - middle[1]
    distance = math.hypot(away_x, away_y)
    half = math.pi
    if distance - reach_m > optics.range_max_m:
        half = -1.0
    elif distance > reach_m:
        half = min(math.asin(reach_m / distance) + OFF_LEVEL_RAD + 0.5 * optics.divergence_rad, math.pi)
    step = (turning.azimuth[0] - turning.azimuth[-1]) / (len(turning.azimuth) - 1)
    return math.atan2(away_y, away_x), half, step


@compiled
def _hit(solids: Solids, number: int, ray: Ray, at: Foot, facing: tuple[float, float], divergence_rad: float) -> Hit:
    size = (solids.size[number, 0], solids.size[number, 1], solids.size[number, 2])
    if solids.shape[number] == CYLINDER:
        return cylinder_hit(ray, at, size[0], size[2], divergence_rad)
    return box_hit(ray, at, facing, size, divergence_rad)


@compiled
def _look(view: _View, number: int, columns: tuple[int, int], nearest: _Nearest) -> None:
    # every shot of some columns at one solid
    solids, optics, here = view.world.solids, view.optics, view.here
    beams = optics.direction.shape[1]
    facing = (here.facing[number, 0], here.facing[number, 1])
    size = (solids.size[number, 0], solids.size[number, 1], solids.size[number, 2])
    for column in range(columns[0], columns[1]):
        after_s = optics.column_s[column]
        at = (
            here.foot[number, 0] + after_s * here.velocity[number, 0],
            here.foot[number, 1] + after_s * here.velocity[number, 1],
            here.foot[number, 2],
        )
        for beam in range(beams):
            shot, ray = column * beams + beam, _ray(view.turning, optics, column, beam)
            if solids.shape[number] == CROWN:
                chance = uniform(view.seed, (shot * len(solids.shape) + number) * DRAWS_A_RAY + LEAF_DRAW)
                hit = crown_hit(ray, at, size, chance)
            else:
                hit = _hit(solids, number, ray, at, facing, optics.divergence_rad)
            part = 0 if hit[2] >= WHOLE else 1
            if hit[0] < nearest.range_m[shot, part]:
                nearest.range_m[shot, part], nearest.cosine[shot, part] = hit[0], hit[1]
                nearest.share[shot, part], nearest.solid[shot, part] = hit[2], number


@compiled
def _look_around(view: _View, nearest: _Nearest) -> None:
    # every solid, in the columns it may be seen in: a turn of the sensor may see it twice
    count, whole = len(view.turning.azimuth), 2.0 * math.pi
    for number in range(len(view.world.solids.shape)):
        size = view.world.solids.size[number]
        reach_m = math.hypot(size[0], size[1]) + SENSOR_MOVES_M
        bearing, half, step = _columns(view, view.here.foot[number], reach_m)
        if half < 0.0:
            continue
        if half >= math.pi:
            _look(view, number, (0, count), nearest)
            continue
        low = math.ceil((view.turning.azimuth[-1] - bearing - half) / whole)
        high = math.floor((view.turning.azimuth[0] - bearing + half) / whole)
        for turn in range(low, high + 1):
            middle = (view.turning.azimuth[0] - bearing - turn * whole) / step
            first, last = math.floor(middle - half / step), math.ceil(middle + half / step) + 1
            _look(view, number, (max(first, 0), min(last, count)), nearest)


@compiled
def _strength(view: _View, hit: tuple[float, float, int]) -> float:
    # of what comes back: range in m, cosine of incidence summed over the beam, material
    share = view.optics.range_max_m / hit[0]
    return float(view.world.reflectivity[hit[2]] * hit[1] * share * share)


@compiled
def _receive(view: _View, shot: int, solid: int, hit: tuple[float, float, int], taken: Taken) -> None:
    # noise and losses of one shot's nearest hit
    optics, draw = view.optics, shot * DRAWS_A_RAY
    loss, spread = _normals(view.seed, draw)
    noise, _ = _normals(view.seed, draw + 2)
    range_m = hit[0] + optics.range_sigma_m * noise
    strength = _strength(view, hit) * math.exp(optics.return_scatter * loss)
    is_lost = strength < optics.return_limit or uniform(view.seed, draw + 4) < optics.dropout
    if is_lost or range_m < optics.range_min_m or range_m > optics.range_max_m:
        return
    told = view.world.intensity[hit[2]] * (1.0 + optics.intensity_scatter * spread)
    taken.range_m[shot] = range_m
    taken.intensity[shot] = min(max(round(told), 0.0), 255.0)
    taken.material[shot] = hit[2]
    taken.solid[shot] = solid


@compiled
def _stronger(
    view: _View, nearest: _Nearest, shot: int, solid: int, behind: tuple[float, float, int]
) -> tuple[int, tuple[float, float, int]]:
    # the solid and the hit that return more: what stops a part of the beam, or what is behind it and gets the rest
    number = nearest.solid[shot, 1]
    before = (nearest.range_m[shot, 1], nearest.cosine[shot, 1], view.world.solids.material[number])
    rest = (behind[0], behind[1] * (1.0 - nearest.share[shot, 1]), behind[2])
    if _strength(view, before) > _strength(view, rest):
        return number, before
    return solid, rest


@compiled
def _cast_sweep(view: _View, nearest: _Nearest, taken: Taken) -> None:
    _look_around(view, nearest)
    middle = view.turning.place[len(view.turning.place) // 2]
    near = streets_near(view.world.ground.street, middle[0], middle[1], GROUND_REACH_M)
    beams = view.optics.direction.shape[1]
    for shot in range(len(nearest.range_m)):
        solid, range_m, cosine = nearest.solid[shot, 0], nearest.range_m[shot, 0], nearest.cosine[shot, 0]
        material = view.world.solids.material[solid] if solid >= 0 else 0
        ray = _ray(view.turning, view.optics, shot // beams, shot % beams)
        ground = ground_hit(view.world.ground, near, ray)
        if ground[0] < range_m:
            solid, range_m, cosine, material = NO_SOLID, ground[0], ground[1], ground[2]
        if nearest.range_m[shot, 1] < range_m:
            solid, (range_m, cosine, material) = _stronger(view, nearest, shot, solid, (range_m, cosine, material))
        if range_m < view.optics.range_max_m:
            _receive(view, shot, solid, (range_m, cosine, material), taken)


@compiled
def cast_sweeps(world: World, optics: Optics, base: Floats, movers: Floats, seed: NDArray[np.uint64]) -> Taken:
    """What comes back in sweeps (s): base (s, c, 3) is the base's x, y in m over the ground and heading in rad at each
    column's time, movers (s, m, 5) as `solids.mover_states` has them at each sweep's begin, seed (s,) the chance's."""
    sweeps, columns, beams = base.shape[0], base.shape[1], optics.direction.shape[1]
    shots = columns * beams
    range_m = np.full((sweeps, shots), np.nan, dtype=np.float32)
    intensity = np.zeros((sweeps, shots), dtype=np.float32)
    material = np.zeros((sweeps, shots), dtype=np.uint8)
    solid = np.full((sweeps, shots), NO_SOLID, dtype=np.int32)
    for sweep in range(sweeps):
        place, axes = sensor_poses(world.ground.wave, optics, base[sweep])
        turning = _Turning(place, axes, base[sweep, :, 2] + optics.azimuth)
        view = _View(world, optics, turning, _placed(world.solids, movers[sweep]), seed[sweep])
        nearest = _Nearest(
            np.full((shots, 2), np.inf), np.zeros((shots, 2)), np.zeros((shots, 2)), np.full((shots, 2), NO_SOLID)
        )
        row = Taken(range_m[sweep], intensity[sweep], material[sweep], solid[sweep])
        _cast_sweep(view, nearest, row)
    return Taken(range_m, intensity, material, solid)

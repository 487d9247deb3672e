"""The ground: a gentle slope, carriageways with markings, and verges a kerb higher.

All of it in metres over the ground from the campus's south-west corner.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint_vehicle.core.lidar_settings import GroundSettings
from trigpoint_vehicle.core.scene.materials import Material
from trigpoint_vehicle.core.streets import Streets

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STREET_HALF_M = 4.0
KERB_M, KERB_WIDTH_M = 0.12, 0.15
KERB_LOWERED_M, KERB_RAMP_M = 16.0, 4.0  # no kerb so far from a junction, and how soon it has its height after that

# Numba takes a global number as a constant, an enumeration's member not.
ASPHALT, PAINT, KERB, GRASS = (int(m) for m in (Material.ASPHALT, Material.PAINT, Material.KERB, Material.GRASS))


class Ground(NamedTuple):
    """wave (w, 5): amplitude, wave numbers along x and y, phase and steepest slope of each wave of the terrain;
    street (m, 4): x and y of begin and end of each carriageway's middle; stripe (k, 6): the markings every street has
    (`markings.STRIPES`)."""

    wave: Floats
    street: Floats
    stripe: Floats


def laid_ground(
    streets: Streets, stripe: Floats, settings: GroundSettings, *, scale: float, rng: np.random.Generator
) -> Ground:
    """The ground under the streets; `scale` is grid metres for one metre on the ground."""
    count = settings.wave_count
    number = 2.0 * np.pi / rng.uniform(settings.wave_length_min_m, settings.wave_length_max_m, count)
    towards, phase = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    amplitude = np.full(count, settings.wave_height_m)
    return Ground(
        wave=np.column_stack(
            [amplitude, number * np.cos(towards), number * np.sin(towards), phase, amplitude * number]
        ),
        street=streets.junction_m[streets.street].reshape(-1, 4) / scale,
        stripe=stripe,
    )


@compiled
def terrain(wave: Floats, x_m: float, y_m: float) -> tuple[float, float, float]:
    """Height of the carriageways' level at a place in m, and its slope to the east and to the north."""
    height_m, east, north = 0.0, 0.0, 0.0
    for number in range(len(wave)):
        angle = wave[number, 1] * x_m + wave[number, 2] * y_m + wave[number, 3]
        rise = wave[number, 0] * math.cos(angle)
        height_m += wave[number, 0] * math.sin(angle)
        east += rise * wave[number, 1]
        north += rise * wave[number, 2]
    return height_m, east, north


@compiled
def beside_street(street: Floats, near: Ints, x_m: float, y_m: float) -> tuple[float, float]:
    """How far a place is outside the nearest carriageway of `near` (below 0 on it), and from the nearest junction."""
    middle, junction = 1e18, 1e18
    for index in near:
        begin_x, begin_y = x_m - street[index, 0], y_m - street[index, 1]
        end_x, end_y = x_m - street[index, 2], y_m - street[index, 3]
        span_x, span_y = begin_x - end_x, begin_y - end_y
        share = (begin_x * span_x + begin_y * span_y) / (span_x * span_x + span_y * span_y)
        share = min(max(share, 0.0), 1.0)
        off_x, off_y = begin_x - share * span_x, begin_y - share * span_y
        middle = min(middle, off_x * off_x + off_y * off_y)
        junction = min(junction, begin_x * begin_x + begin_y * begin_y, end_x * end_x + end_y * end_y)
    return math.sqrt(middle) - STREET_HALF_M, math.sqrt(junction)


@compiled
def kerb_m(junction_m: float) -> float:
    """The kerb's height so far from a junction."""
    share = min(max((junction_m - KERB_LOWERED_M) / KERB_RAMP_M, 0.0), 1.0)
    return KERB_M * share * share * (3.0 - 2.0 * share)


@compiled
def _on_stripe(stripe: Floats, number: int, along_m: float, left_m: float, length_m: float) -> bool:
    first = stripe[number, 0] if stripe[number, 0] >= 0.0 else length_m + stripe[number, 0]
    last = stripe[number, 1] if stripe[number, 1] >= 0.0 else length_m + stripe[number, 1]
    within = first <= along_m <= last and stripe[number, 4] <= left_m <= stripe[number, 5]
    return bool(within and (along_m - first) % stripe[number, 2] < stripe[number, 3])


@compiled
def is_painted(ground: Ground, near: Ints, x_m: float, y_m: float) -> bool:
    """Whether a marking of any street of `near` is at a place."""
    for index in near:
        begin_x, begin_y = ground.street[index, 0], ground.street[index, 1]
        span_x, span_y = ground.street[index, 2] - begin_x, ground.street[index, 3] - begin_y
        length_m = math.sqrt(span_x * span_x + span_y * span_y)
        ahead_x, ahead_y = span_x / length_m, span_y / length_m
        along_m = (x_m - begin_x) * ahead_x + (y_m - begin_y) * ahead_y
        left_m = (y_m - begin_y) * ahead_x - (x_m - begin_x) * ahead_y
        if abs(left_m) > STREET_HALF_M or along_m < 0.0 or along_m > length_m:
            continue
        for number in range(len(ground.stripe)):
            if _on_stripe(ground.stripe, number, along_m, left_m, length_m):
                return True
    return False


@compiled
def material_of(ground: Ground, near: Ints, x_m: float, y_m: float) -> int:
    """The ground's material at a place."""
    beyond_m, _ = beside_street(ground.street, near, x_m, y_m)
    if beyond_m > KERB_WIDTH_M:
        return GRASS
    if beyond_m > 0.0:
        return KERB
    return PAINT if is_painted(ground, near, x_m, y_m) else ASPHALT


@compiled
def surface_m(ground: Ground, near: Ints, x_m: float, y_m: float) -> float:
    """Height of what one stands on at a place."""
    height_m = terrain(ground.wave, x_m, y_m)[0]
    beyond_m, junction_m = beside_street(ground.street, near, x_m, y_m)
    return height_m + kerb_m(junction_m) if beyond_m > 0.0 else height_m


@compiled
def streets_near(street: Floats, x_m: float, y_m: float, reach_m: float) -> Ints:
    """The numbers of the streets within reach of a place, never none."""
    found, nearest, least_m = np.empty(len(street), dtype=np.int64), 0, 1e18
    one, count = np.empty(1, dtype=np.int64), 0
    for index in range(len(street)):
        one[0] = index
        away_m = beside_street(street, one, x_m, y_m)[0]
        if away_m < least_m:
            nearest, least_m = index, away_m
        if away_m < reach_m:
            found[count] = index
            count += 1
    if count == 0:
        found[0], count = nearest, 1
    return found[:count]


@compiled
def _surface_of_all(ground: Ground, place_m: Floats) -> Floats:
    all_streets, height_m = np.arange(len(ground.street)), np.empty(len(place_m))
    for number in range(len(place_m)):
        height_m[number] = surface_m(ground, all_streets, place_m[number, 0], place_m[number, 1])
    return height_m


@compiled
def _materials_of_all(ground: Ground, place_m: Floats) -> Ints:
    all_streets, material = np.arange(len(ground.street)), np.empty(len(place_m), dtype=np.int64)
    for number in range(len(place_m)):
        material[number] = material_of(ground, all_streets, place_m[number, 0], place_m[number, 1])
    return material


def surface_heights_m(ground: Ground, place_m: Floats) -> Floats:
    """Height (n,) of what one stands on at places (n, 2): carriageway, or verge with its kerb."""
    return _surface_of_all(ground, np.ascontiguousarray(place_m, dtype=np.float64))


def ground_materials(ground: Ground, place_m: Floats) -> Ints:
    """The ground's material (n,) at places (n, 2)."""
    return _materials_of_all(ground, np.ascontiguousarray(place_m, dtype=np.float64))

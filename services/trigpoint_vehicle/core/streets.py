"""The campus's streets and closed routes through them."""

import bisect
import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.geodesy.poses import wrap_angle_rad
from trigpoint_vehicle.core.campus_settings import RouteSettings, StreetSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Route = tuple[int, ...]

# Junctions as shares of the campus's width and height: a ring road, the quadrangle's ring, and what links them.
JUNCTIONS = {
    "west-south": (0.03, 0.15),
    "west": (0.02, 0.53),
    "west-north": (0.13, 0.93),
    "north": (0.50, 0.97),
    "east-north": (0.90, 0.91),
    "east": (0.98, 0.52),
    "east-south": (0.96, 0.11),
    "south-east": (0.66, 0.13),
    "south-west": (0.36, 0.07),
    "middle-west": (0.27, 0.54),
    "middle-east": (0.74, 0.53),
    "quad-south-west": (0.42, 0.59),
    "quad-south-east": (0.575, 0.59),
    "quad-north-east": (0.575, 0.81),
    "quad-north-west": (0.42, 0.81),
}
QUADRANGLE = ("quad-south-west", "quad-south-east", "quad-north-east", "quad-north-west")
STREETS = (
    ("west-south", "west"),
    ("west", "west-north"),
    ("west-north", "north"),
    ("north", "east-north"),
    ("east-north", "east"),
    ("east", "east-south"),
    ("east-south", "south-east"),
    ("south-east", "south-west"),
    ("south-west", "west-south"),
    ("west", "middle-west"),
    ("middle-west", "quad-south-west"),
    ("middle-west", "south-west"),
    ("quad-south-west", "quad-south-east"),
    ("quad-south-east", "quad-north-east"),
    ("quad-north-east", "quad-north-west"),
    ("quad-north-west", "quad-south-west"),
    ("quad-north-west", "north"),
    ("quad-south-east", "middle-east"),
    ("middle-east", "east"),
    ("middle-east", "south-east"),
)
APART = (
    ("west-south", "west", "middle-west", "south-west"),
    ("east-south", "east", "middle-east", "south-east"),
)
ROUTE_ATTEMPTS = 1200


@dataclass(frozen=True, slots=True, kw_only=True)
class Streets:
    """junction_m (n, 2) in grid metres from the campus's corner; street (m, 2) the junctions each joins;
    length_m (m,); in_quadrangle (m,) whether a street belongs to the quadrangle's ring."""

    junction_m: Floats
    street: Ints
    length_m: Floats
    in_quadrangle: NDArray[np.bool_]


def laid_streets(settings: StreetSettings, rng: np.random.Generator) -> Streets:
    """The network with junctions moved a little, so that each seed is a campus of its own."""
    names = list(JUNCTIONS)
    junction_m = np.array([JUNCTIONS[name] for name in names]) * (settings.width_m, settings.height_m)
    junction_m = junction_m + rng.normal(0.0, settings.junction_jitter_m, junction_m.shape)
    junction_m = np.clip(junction_m, 0.0, (settings.width_m, settings.height_m))
    street = np.array([(names.index(a), names.index(b)) for a, b in STREETS], dtype=np.int64)
    length_m = np.linalg.norm(junction_m[street[:, 0]] - junction_m[street[:, 1]], axis=1)
    in_quadrangle = np.array([a in QUADRANGLE and b in QUADRANGLE for a, b in STREETS])
    return Streets(junction_m=junction_m, street=street, length_m=length_m, in_quadrangle=in_quadrangle)


def quadrangle_box_m(streets: Streets, margin_m: float) -> tuple[Floats, Floats]:
    """South-west and north-east corners (2,) of the quadrangle with its margin, in grid metres."""
    ring = streets.junction_m[streets.street[streets.in_quadrangle].ravel()]
    return ring.min(axis=0) - margin_m, ring.max(axis=0) + margin_m


@dataclass(frozen=True, slots=True)
class _Walk:
    junctions: Route
    streets: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class _Ways:
    """`onward[(before, here)]` lists (junction, street) that may follow; `before` is -1 at the start."""

    onward: dict[tuple[int, int], list[tuple[int, int]]]
    length_m: tuple[float, ...]


def _turn_rad(before: Floats, here: Floats, after: Floats) -> float:
    angle = np.arctan2(*(after - here)[::-1]) - np.arctan2(*(here - before)[::-1])
    return abs(wrap_angle_rad(float(angle)))


def _ways(streets: Streets, turn_max_rad: float) -> _Ways:
    both = [(a, b, number) for number, (a, b) in enumerate(streets.street.tolist())]
    both += [(b, a, number) for a, b, number in both]
    onward: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for here, after, number in both:
        onward.setdefault((-1, here), []).append((after, number))
        for before in {a for a, b, _ in both if b == here}:
            corner = streets.junction_m[[before, here, after]]
            if before != after and _turn_rad(*corner) <= turn_max_rad:
                onward.setdefault((before, here), []).append((after, number))
    return _Ways(onward, tuple(streets.length_m.tolist()))


def _random_walk(ways: _Ways, settings: RouteSettings, start: int, rng: np.random.Generator) -> _Walk | None:
    before, here, length_m = -1, start, 0.0
    junctions, driven = [start], list[int]()
    while length_m < settings.length_max_m and (before, here) in ways.onward:
        choices = ways.onward[before, here]
        reach = list(itertools.accumulate(1.0 / (1.0 + 3.0 * driven.count(number)) for _, number in choices))
        before, (here, number) = here, choices[bisect.bisect(reach, rng.random() * reach[-1])]
        junctions.append(here)
        driven.append(number)
        length_m += ways.length_m[number]
        if here == start and settings.length_min_m <= length_m <= settings.length_max_m:
            return _Walk(tuple(junctions), tuple(driven))
    return None


def _lack(streets: Streets, settings: RouteSettings, walk: _Walk, others: list[_Walk]) -> float:
    # by how much, in shares of length, a walk misses what is wanted of it
    length_m, mine = streets.length_m, set(walk.streets)
    own_m = float(length_m[sorted(mine)].sum())
    revisited = 1.0 - own_m / float(length_m[list(walk.streets)].sum())
    shared = [_overlap(length_m, mine, set(other.streets)) for other in others]
    misses = [settings.coverage_min - own_m / float(length_m.sum()), settings.revisited_min - revisited]
    misses += [settings.shared_min - share for share in shared] + [share - settings.shared_max for share in shared]
    return sum(max(miss, 0.0) for miss in misses)


def _overlap(length_m: Floats, mine: set[int], theirs: set[int]) -> float:
    return float(length_m[sorted(mine & theirs)].sum() / length_m[sorted(mine | theirs)].sum())


def _loop(streets: Streets, settings: RouteSettings, others: list[_Walk], rng: np.random.Generator) -> _Walk:
    ways, ring = _ways(streets, settings.turn_max_rad), set(np.flatnonzero(streets.in_quadrangle).tolist())
    best, best_lack = None, math.inf
    for _ in range(ROUTE_ATTEMPTS):
        walk = _random_walk(ways, settings, int(rng.integers(len(streets.junction_m))), rng)
        if walk is None or not ring <= set(walk.streets):
            continue
        lack = _lack(streets, settings, walk, others)
        if lack < best_lack:
            best, best_lack = walk, lack
        if lack == 0.0:
            break
    if best is None:
        limits = f"{settings.length_min_m:.0f} to {settings.length_max_m:.0f} m"
        raise InputError(f"no loop of {limits} through the quadrangle in {ROUTE_ATTEMPTS} attempts")
    return best


def _laps(streets: Streets, settings: RouteSettings, vehicle_index: int) -> Route:
    names = list(JUNCTIONS)
    lap = [names.index(name) for name in APART[vehicle_index % len(APART)]]
    corners = streets.junction_m[lap]
    lap_m = float(np.linalg.norm(corners - np.roll(corners, -1, axis=0), axis=1).sum())
    return tuple(lap * max(1, round(settings.length_min_m / lap_m)) + lap[:1])


def planned_routes_m(
    streets: Streets, settings: RouteSettings, *, vehicles: int, rng: np.random.Generator
) -> tuple[Floats, ...]:
    """One line of corners (k, 2) a vehicle in grid metres, as `settings.plan` says.

    Raises InputError for no such plan, and where no loop can be found.
    """
    if settings.plan == "loop":
        walks: list[_Walk] = []
        for _ in range(vehicles):
            walks.append(_loop(streets, settings, walks, rng))
        return tuple(streets.junction_m[list(walk.junctions)] for walk in walks)
    if settings.plan == "apart":
        return tuple(streets.junction_m[list(_laps(streets, settings, index))] for index in range(vehicles))
    if settings.plan in ("straight", "standing"):
        middle = streets.junction_m[list(JUNCTIONS).index("middle-west")]
        return (np.array([middle, middle + (settings.straight_length_m, 0.0)]),) * vehicles
    raise InputError(f"plan {settings.plan!r} is none of loop, apart, straight, standing")

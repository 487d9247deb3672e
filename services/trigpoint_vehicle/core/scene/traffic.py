"""Parked cars, other ones in each session, and cars and walkers that move."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint_vehicle.core.lidar_settings import TrafficSettings
from trigpoint_vehicle.core.motion import Motion
from trigpoint_vehicle.core.scene.buildings import is_inside
from trigpoint_vehicle.core.scene.free_ground import FreeGround, is_apart, spread_out
from trigpoint_vehicle.core.streets import Streets

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

CANDIDATES_FACTOR = 12  # places or ways drawn for each one wanted
PARKED_FROM_JUNCTION_M, PARKED_APART_M = 22.0, 5.6
PARKED_STREET_M, PARKED_DRIVEN_M, PARKED_BUILDING_M = 4.9, 1.9, 2.5
CAR_TURNS_M = 15.0  # from a street's end
WALK_STEP_M = 0.5
WATCHED_EVERY = 20  # samples of a motion: at 5 Hz


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """What stands on the campus: places (k, 2) of poles, trunks and corners, footprints (b, 4, 2) of buildings."""

    place_m: Floats
    footprint: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Parking:
    """Places (n, 2) along the streets, the direction cars face there in rad, their size as a share of the usual."""

    place_m: Floats
    facing_rad: Floats
    size: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Movers:
    """What goes to and fro between begin_m and end_m (n, 2), so far to the left of its way (n,); `phase_m` how far it
    is at time 0. Cars and walkers."""

    begin_m: Floats
    end_m: Floats
    left_m: Floats
    speed_mps: Floats
    phase_m: Floats
    is_car: Bools

    def at(self, time_s: float) -> tuple[Floats, Floats]:
        """Places and velocities (n, 2) at a time."""
        span_m = self.end_m - self.begin_m
        length_m = np.hypot(*span_m.T)
        gone_m = (self.phase_m + self.speed_mps * time_s) % (2.0 * length_m)
        way = np.where(gone_m < length_m, 1.0, -1.0)
        ahead = way[:, None] * span_m / length_m[:, None]
        along_m = np.where(gone_m < length_m, gone_m, 2.0 * length_m - gone_m)
        left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
        place_m = self.begin_m + along_m[:, None] * span_m / length_m[:, None] + self.left_m[:, None] * left
        return place_m, self.speed_mps[:, None] * ahead

    def chosen(self, which: Bools) -> "Movers":
        """Some of them."""
        return Movers(
            begin_m=self.begin_m[which],
            end_m=self.end_m[which],
            left_m=self.left_m[which],
            speed_mps=self.speed_mps[which],
            phase_m=self.phase_m[which],
            is_car=self.is_car[which],
        )


def _drawn_streets(streets: Streets, count: int, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    # begin (n, 2), direction (n, 2) and length (n,) of streets drawn by their length
    street = streets.street[rng.choice(len(streets.street), size=count, p=streets.length_m / streets.length_m.sum())]
    begin_m, end_m = streets.junction_m[street[:, 0]], streets.junction_m[street[:, 1]]
    length_m = np.hypot(*(end_m - begin_m).T)
    return begin_m, (end_m - begin_m) / length_m[:, None], length_m


def _leftwards(ahead: Floats) -> Floats:
    return np.column_stack([-ahead[:, 1], ahead[:, 0]])


def _outside(place_m: Floats, footprint: Floats, margin_m: float) -> Bools:
    outside = np.ones(len(place_m), dtype=np.bool_)
    for one in footprint:
        outside &= ~is_inside(one, place_m, margin_m)
    return outside


def parking_places(
    standing: Standing, free: FreeGround, settings: TrafficSettings, rng: np.random.Generator
) -> Parking:
    """Places beside the carriageways, clear of what stands, up to as many as are wanted."""
    count = CANDIDATES_FACTOR * settings.parking_count
    begin_m, ahead, length_m = _drawn_streets(free.streets, count, rng)
    along_m = PARKED_FROM_JUNCTION_M + rng.uniform(size=count) * (length_m - 2.0 * PARKED_FROM_JUNCTION_M)
    side = rng.choice([-1.0, 1.0], count)
    place_m = begin_m + along_m[:, None] * ahead + (side * settings.parking_across_m)[:, None] * _leftwards(ahead)
    clear = free.is_clear(place_m, street_m=PARKED_STREET_M, driven_m=PARKED_DRIVEN_M) & (
        length_m > 2.0 * PARKED_FROM_JUNCTION_M
    )
    clear &= is_apart(place_m, standing.place_m, settings.parking_clearance_m)
    clear &= _outside(place_m, standing.footprint, PARKED_BUILDING_M)
    place_m, facing_rad = place_m[clear], np.arctan2(ahead[clear, 1], ahead[clear, 0])
    chosen = spread_out(place_m, count=settings.parking_count, distance_m=PARKED_APART_M)
    return Parking(place_m=place_m[chosen], facing_rad=facing_rad[chosen], size=rng.uniform(0.92, 1.08, len(chosen)))


def _cars(streets: Streets, settings: TrafficSettings, rng: np.random.Generator) -> Movers:
    count = CANDIDATES_FACTOR * settings.cars_moving
    begin_m, ahead, length_m = _drawn_streets(streets, count, rng)
    return Movers(
        begin_m=begin_m + CAR_TURNS_M * ahead,
        end_m=begin_m + (length_m - CAR_TURNS_M)[:, None] * ahead,
        left_m=np.full(count, settings.lane_across_m),
        speed_mps=rng.uniform(settings.car_speed_min_mps, settings.car_speed_max_mps, count),
        phase_m=rng.uniform(0.0, 2.0, count) * length_m,
        is_car=np.ones(count, dtype=np.bool_),
    )


def _walkers(streets: Streets, settings: TrafficSettings, rng: np.random.Generator) -> Movers:
    count = CANDIDATES_FACTOR * settings.walkers
    begin_m, ahead, length_m = _drawn_streets(streets, count, rng)
    across_m = rng.uniform(settings.walker_across_min_m, settings.walker_across_max_m, count)
    aside_m = (across_m * rng.choice([-1.0, 1.0], count))[:, None] * _leftwards(ahead)
    first_m = rng.uniform(size=count) * np.maximum(length_m - settings.walk_length_m, 0.0)
    return Movers(
        begin_m=begin_m + first_m[:, None] * ahead + aside_m,
        end_m=begin_m + (first_m + settings.walk_length_m)[:, None] * ahead + aside_m,
        left_m=np.zeros(count),
        speed_mps=rng.uniform(settings.walker_speed_min_mps, settings.walker_speed_max_mps, count),
        phase_m=rng.uniform(0.0, 2.0 * settings.walk_length_m, count),
        is_car=np.zeros(count, dtype=np.bool_),
    )


def _clear_of_vehicle(movers: Movers, motion: Motion, distance_m: float) -> Bools:
    nearest_m = np.full(len(movers.is_car), np.inf)
    for time_s, pose in zip(motion.time_s[::WATCHED_EVERY].tolist(), motion.pose[::WATCHED_EVERY], strict=True):
        nearest_m = np.minimum(nearest_m, np.hypot(*(movers.at(time_s)[0] - pose[:2]).T))
    return nearest_m >= distance_m


def _clear_of_standing(movers: Movers, standing: Standing, distance_m: float) -> Bools:
    clear = np.ones(len(movers.is_car), dtype=np.bool_)
    longest_m = float(np.hypot(*(movers.end_m - movers.begin_m).T).max(initial=0.0))
    for share in np.linspace(0.0, 1.0, round(longest_m / WALK_STEP_M) + 1):
        place_m = movers.begin_m + share * (movers.end_m - movers.begin_m)
        clear &= is_apart(place_m, standing.place_m, distance_m) & _outside(place_m, standing.footprint, distance_m)
    return clear


def _first(which: Bools, count: int) -> Bools:
    return which & (np.cumsum(which) <= count)


def drawn_movers(
    standing: Standing, streets: Streets, motion: Motion, settings: TrafficSettings, rng: np.random.Generator
) -> tuple[Movers, ...]:
    """Cars and walkers of one session: none ever close to its vehicle, walkers clear of what stands."""
    cars, walkers = _cars(streets, settings, rng), _walkers(streets, settings, rng)
    drivable = _clear_of_vehicle(cars, motion, settings.clear_of_vehicle_m)
    walkable = _clear_of_vehicle(walkers, motion, settings.clear_of_vehicle_m)
    walkable &= _clear_of_standing(walkers, standing, settings.clear_of_standing_m)
    return (
        cars.chosen(_first(drivable, settings.cars_moving)),
        walkers.chosen(_first(walkable, settings.walkers)),
    )

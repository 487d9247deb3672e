"""What a consumer satellite receiver says: noise, a slow bias, reflections, and an underground car park."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint_vehicle.core.campus_settings import CarParkSettings, GnssSettings, MultipathSettings
from trigpoint_vehicle.core.correlated import gauss_markov

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

CLEAR, MULTIPATH, CAR_PARK = "clear", "multipath", "car park"


@dataclass(frozen=True, slots=True, kw_only=True)
class FixErrors:
    """error_m (n, 2) east and north of the true antenna, and each fix's state."""

    error_m: Floats
    state: tuple[str, ...]


def _turned(distance_m: Floats, rng: np.random.Generator) -> Floats:
    turn = rng.uniform(0.0, 2.0 * np.pi, len(distance_m))
    turned: Floats = distance_m[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    return turned


def _log_uniform(low: float, high: float, count: int, rng: np.random.Generator) -> Floats:
    drawn: Floats = np.exp(rng.uniform(np.log(low), np.log(high), count))
    return drawn


def _multipath_m(time_s: Floats, settings: MultipathSettings, rng: np.random.Generator) -> Floats:
    # each stretch lies in its own part of the drive, so that stretches never join
    shift_m = np.zeros((len(time_s), 2))
    part_s = float(time_s[-1]) / max(settings.count, 1)
    duration_s = rng.uniform(settings.duration_min_s, settings.duration_max_s, settings.count)
    begin_s = part_s * (np.arange(settings.count) + rng.uniform(0.15, 0.75, settings.count))
    direction = _turned(rng.uniform(settings.shift_min_m, settings.shift_max_m, settings.count), rng)
    for begin, duration, shift in zip(begin_s, duration_s, direction, strict=True):
        shift_m[(time_s >= begin) & (time_s < begin + duration)] = shift
    return shift_m


def _car_park_m(time_s: Floats, settings: CarParkSettings, rng: np.random.Generator) -> tuple[Floats, Flags]:
    begin_s = float(time_s[-1]) * rng.uniform(settings.begin_min, settings.begin_max)
    inside = (time_s >= begin_s) & (time_s < begin_s + settings.duration_s)
    shift_m = _turned(_log_uniform(settings.shift_min_m, settings.shift_max_m, len(time_s), rng), rng)
    together_s = begin_s + rng.uniform(0.0, max(settings.duration_s - settings.coherent_s, 0.0))
    together = (time_s >= together_s) & (time_s < together_s + settings.coherent_s)
    distance_m = rng.uniform(settings.coherent_shift_min_m, settings.coherent_shift_max_m, 1)
    shift_m[together] = _turned(distance_m, rng)
    return np.where(inside[:, None], shift_m, 0.0), inside


def fix_errors(time_s: Floats, settings: GnssSettings, rng: np.random.Generator) -> FixErrors:
    """The errors of fixes at instants (n,) in seconds of a drive."""
    step_s = 1.0 / settings.rate_hz
    white = rng.normal(0.0, settings.white_m, (len(time_s), 2))
    slow = gauss_markov(len(time_s), 2, sigma=settings.bias_m, step_s=step_s, time_s=settings.bias_time_s, rng=rng)
    reflected = _multipath_m(time_s, settings.multipath, rng)
    lost, inside = np.zeros_like(reflected), np.zeros(len(time_s), dtype=bool)
    if settings.car_park is not None:
        lost, inside = _car_park_m(time_s, settings.car_park, rng)
    reflected[inside] = 0.0
    shifted = reflected.any(axis=1)
    state = np.where(inside, CAR_PARK, np.where(shifted, MULTIPATH, CLEAR))
    return FixErrors(error_m=white + slow + reflected + lost, state=tuple(state.tolist()))

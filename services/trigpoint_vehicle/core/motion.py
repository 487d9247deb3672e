"""A vehicle's true motion along its route: a smooth path and a speed that suits its bends."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from trigpoint_vehicle.core.campus_settings import MotionSettings, RouteSettings, StreetSettings
from trigpoint_vehicle.core.correlated import gauss_markov

Floats = NDArray[np.float64]

PATH_STEP_M = 0.5
SMOOTHING_REACH = 4.0  # sigmas after which a Gaussian kernel is cut


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """The base's true motion. time_s (n,) from setting off at a constant step; pose (n, 3): x, y in grid metres
    from the campus's corner, heading in rad, continuous; speed in grid metres a second, acceleration, yaw rate (n,)."""

    time_s: Floats
    pose: Floats
    speed_mps: Floats
    acceleration_mps2: Floats
    yaw_rate_radps: Floats


def _resampled(corner_m: Floats, step_m: float) -> Floats:
    along_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corner_m, axis=0), axis=1))])
    at_m = np.linspace(0.0, along_m[-1], max(2, round(along_m[-1] / step_m) + 1))
    return np.column_stack([np.interp(at_m, along_m, corner_m[:, axis]) for axis in (0, 1)])


def _extended(corner_m: Floats, reach_m: float) -> Floats:
    first = (corner_m[0] - corner_m[1]) / np.linalg.norm(corner_m[0] - corner_m[1])
    last = (corner_m[-1] - corner_m[-2]) / np.linalg.norm(corner_m[-1] - corner_m[-2])
    return np.vstack([corner_m[0] + reach_m * first, corner_m, corner_m[-1] + reach_m * last])


def _in_lane(corner_m: Floats, offset_m: float) -> Floats:
    # every stretch moved to its left; neighbouring stretches meet on the bisector of their corner
    ahead = np.diff(corner_m, axis=0)
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]]) / np.linalg.norm(ahead, axis=1, keepdims=True)
    before, after = np.vstack([left[:1], left]), np.vstack([left, left[-1:]])
    moved: Floats = corner_m + offset_m * (before + after) / (1.0 + (before * after).sum(axis=1, keepdims=True))
    return moved


def driven_line_m(corner_m: Floats, settings: StreetSettings, rng: np.random.Generator) -> Floats:
    """The line driven (n, 2), about every half metre: corners rounded, in the left lane, wandering a little in it."""
    reach_m = SMOOTHING_REACH * settings.corner_smoothing_m
    line = _resampled(_extended(_in_lane(corner_m, settings.lane_offset_m), reach_m), PATH_STEP_M)
    smooth = gaussian_filter1d(line, settings.corner_smoothing_m / PATH_STEP_M, axis=0, truncate=SMOOTHING_REACH)
    ends = round(reach_m / PATH_STEP_M)
    tangent = np.gradient(smooth, axis=0)
    left = np.column_stack([-tangent[:, 1], tangent[:, 0]]) / np.linalg.norm(tangent, axis=1, keepdims=True)
    length = settings.lane_wander_length_m
    wander = gauss_markov(len(line), 1, sigma=settings.lane_wander_m, step_s=PATH_STEP_M, time_s=length, rng=rng)
    wander = gaussian_filter1d(wander, length / 4.0 / PATH_STEP_M, axis=0)
    driven: Floats = (smooth + wander * left)[ends:-ends]
    return driven


def _curvature(line: CubicSpline, at_m: Floats) -> Floats:
    first, second = line(at_m, 1), line(at_m, 2)
    bend: Floats = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / np.linalg.norm(first, axis=1) ** 3
    return bend


def _speed_limits(curvature: Floats, step_m: float, settings: MotionSettings, rng: np.random.Generator) -> Floats:
    count, span = len(curvature), settings.speed_max_mps - settings.speed_min_mps
    length = settings.speed_variation_length_m
    mood = gauss_markov(count, 1, sigma=settings.speed_variation, step_s=step_m, time_s=length, rng=rng)[:, 0]
    mood = gaussian_filter1d(mood, length / 6.0 / step_m)
    wish = settings.speed_min_mps + span * np.clip(0.5 + mood, 0.0, 1.0)
    bend = np.sqrt(settings.lateral_acceleration_max_mps2 / np.maximum(np.abs(curvature), 1e-6))
    limit: Floats = np.minimum(wish, np.maximum(bend, settings.bend_speed_min_mps))
    return limit


def _within_acceleration(limit_mps: Floats, step_m: float, acceleration_mps2: float) -> Floats:
    # v^2 may change by 2 a ds from point to point, forwards and backwards, from and to a standstill
    squared = limit_mps**2
    rise = 2.0 * acceleration_mps2 * step_m
    index = np.arange(len(squared))
    forwards = np.minimum.accumulate(squared - rise * index) + rise * index
    both = np.minimum.accumulate((forwards + rise * index)[::-1])[::-1] - rise * index
    ends = rise * np.minimum(index, index[::-1])
    speed: Floats = np.sqrt(np.minimum(both, ends))
    return speed


def _travelled(speed_mps: Floats, step_m: float, settings: MotionSettings) -> tuple[Floats, Floats]:
    # constant acceleration within a step: dt = 2 ds / (v0 + v1)
    time_s = np.concatenate([[0.0], np.cumsum(2.0 * step_m / (speed_mps[:-1] + speed_mps[1:]))])
    duration_s = float(time_s[-1]) + 2.0 * settings.waiting_s
    at_s = np.arange(0.0, duration_s, settings.step_s)
    along_m = np.interp(at_s - settings.waiting_s, time_s, step_m * np.arange(len(speed_mps)))
    # rounds the jerk away, so that speed and acceleration are smooth as well
    return at_s, gaussian_filter1d(along_m, 0.3 / settings.step_s, mode="nearest")


def motion_along(line_m: Floats, settings: MotionSettings, rng: np.random.Generator) -> Motion:
    """The motion along a line (n, 2) from standstill to standstill, no slip sideways: heading is the tangent."""
    along_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m, axis=0), axis=1))])
    line = CubicSpline(along_m, line_m)
    even_m = np.linspace(0.0, along_m[-1], len(along_m))
    step_m = float(even_m[1])
    limit = _speed_limits(_curvature(line, even_m), step_m, settings, rng)
    speed = _within_acceleration(limit, step_m, settings.acceleration_max_mps2)
    time_s, at_m = _travelled(speed, step_m, settings)
    tangent = line(at_m, 1)
    rate = np.gradient(at_m, settings.step_s) * np.linalg.norm(tangent, axis=1)
    return Motion(
        time_s=time_s,
        pose=np.column_stack([line(at_m), np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))]),
        speed_mps=rate,
        acceleration_mps2=np.gradient(rate, settings.step_s),
        yaw_rate_radps=rate * _curvature(line, at_m),
    )


def standing_motion(corner_m: Floats, route: RouteSettings, settings: MotionSettings) -> Motion:
    """A vehicle that never moves from the first corner, facing the second."""
    time_s = np.arange(0.0, route.standing_s, settings.step_s)
    ahead = corner_m[1] - corner_m[0]
    pose = np.array([corner_m[0, 0], corner_m[0, 1], np.arctan2(ahead[1], ahead[0])])
    still = np.zeros(len(time_s))
    return Motion(
        time_s=time_s,
        pose=np.tile(pose, (len(time_s), 1)),
        speed_mps=still,
        acceleration_mps2=still,
        yaw_rate_radps=still,
    )

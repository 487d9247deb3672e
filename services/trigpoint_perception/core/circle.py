"""Circles fitted to arcs that were seen from one side, with honest covariances."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ITERATIONS_MAX = 8
STEP_M = 1e-5  # a step as short is the last
RADIUS_MIN_M = 0.02
MEAN_DEPTH = 0.785  # of a cylinder's visible points before its axis, radii
DIVERGENCE_RAD = 0.003  # full width of a usual sensor's beam
SYSTEMATIC_SIGMA_M = 0.015  # of the sensor's calibration and the object's shape; no number of points lowers it
SHARED_POINTS = 9.0  # neighbours' errors go together (a surface's reflectivity and tilt): these count as one


@dataclass(frozen=True, slots=True, kw_only=True)
class Arcs:
    """Points of upright cylinders (k,) seen from `viewpoint_m` (2,), and the angles their segments span there.

    Cylinder i has the points point_m[point_begin[i] : point_begin[i + 1]], (n, 2), and the angles of
    width_rad[width_begin[i] : width_begin[i + 1]]; neighbouring beams are `step_rad` apart.
    """

    point_m: Floats
    point_begin: Ints
    width_rad: Floats
    width_begin: Ints
    viewpoint_m: Floats
    step_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Circles:
    """Circles (k,): centres (k, 2) with covariances (k, 2, 2) in m^2, radii with their 1-sigma; `residual_m` the
    points' root mean square distances."""

    centre_m: Floats
    covariance_m2: Floats
    radius_m: Floats
    radius_sigma_m: Floats
    residual_m: Floats


def fitted_circles(arcs: Arcs, *, range_sigma_m: float, radius_max_m: float) -> Circles:
    """The circles nearest to the points, their radii held by the widths the objects covered.

    Gauss-Newton on geometric distances (Huber's weights) with the angular width as a measurement of the radius: from
    one side alone the points hardly tell a large circle from a near one, and the covariance says so. Its scale is the
    larger of the sensor's noise and the residuals found. Neighbours' errors are taken as shared, the width's are its
    own; noise is along the rays, so that the middle between the edges tells the direction best.
    """
    limits = np.array([arcs.step_rad, range_sigma_m, radius_max_m])
    state, covariance, residual_m = _all_fitted(
        arcs.point_m, arcs.point_begin, arcs.width_rad, arcs.width_begin, arcs.viewpoint_m, limits
    )
    return Circles(
        centre_m=state[:, :2],
        covariance_m2=covariance[:, :2, :2],
        radius_m=state[:, 2],
        radius_sigma_m=np.sqrt(covariance[:, 2, 2]),
        residual_m=residual_m,
    )


@compiled
def _all_fitted(
    point_m: Floats, point_begin: Ints, width_rad: Floats, width_begin: Ints, viewpoint_m: Floats, limits: Floats
) -> tuple[Floats, Floats, Floats]:
    """`_fitted` of each arc: states (k, 3), covariances (k, 3, 3), residuals (k,)."""
    count = len(point_begin) - 1
    state, covariance, residual_m = np.empty((count, 3)), np.empty((count, 3, 3)), np.empty(count)
    for arc in range(count):
        points = point_m[point_begin[arc] : point_begin[arc + 1]]
        widths = width_rad[width_begin[arc] : width_begin[arc + 1]]
        state[arc], covariance[arc], residual_m[arc] = _fitted(points, viewpoint_m, widths, limits)
    return state, covariance, residual_m


@compiled
def _fitted(point_m: Floats, viewpoint_m: Floats, width_rad: Floats, limits: Floats) -> tuple[Floats, Floats, float]:
    """Centre and radius (3,), their covariance (3, 3), the residual; limits (3,): step, range's sigma, radius."""
    step_rad, sigma_m, radius_max_m = limits
    sight_m = np.array([point_m[:, 0].mean(), point_m[:, 1].mean()]) - viewpoint_m
    away_m = np.hypot(sight_m[0], sight_m[1])
    edges_rad = _edges_sigma_rad(width_rad, step_rad)
    seen_m, prior_sigma_m = _radius(width_rad, step_rad, edges_rad, away_m)
    left = np.array([-sight_m[1], sight_m[0]]) / away_m
    across_sigma_m = 0.5 * away_m * edges_rad
    prior_m = min(max(seen_m, RADIUS_MIN_M), radius_max_m)
    state = np.empty(3)
    state[:2] = viewpoint_m + sight_m * (1.0 + MEAN_DEPTH * prior_m / away_m)
    state[2] = prior_m
    information = np.eye(3)
    shared = min(SHARED_POINTS, len(point_m))
    for _ in range(ITERATIONS_MAX):
        information, gradient = _normal_equations(point_m, state, sigma_m)
        information, gradient = information / shared, gradient / shared
        information[2, 2] += 1.0 / prior_sigma_m**2
        gradient[2] += (state[2] - prior_m) / prior_sigma_m**2
        _add_direction(information, gradient, left / across_sigma_m, state[:2] - viewpoint_m)
        information[0, 0] += 1e-6 / prior_sigma_m**2  # solvable where all points lie in one direction
        information[1, 1] += 1e-6 / prior_sigma_m**2
        before = state
        state = before - np.linalg.solve(information, gradient)
        state[2] = min(max(state[2], RADIUS_MIN_M), radius_max_m)
        if np.abs(state - before).max() < STEP_M:
            break
    away = np.sqrt((point_m[:, 0] - state[0]) ** 2 + (point_m[:, 1] - state[1]) ** 2) - state[2]
    residual_m = np.sqrt((away**2).mean())
    return state, _covariance(information, residual_m / sigma_m), residual_m


@compiled
def _covariance(information: Floats, scale: float) -> Floats:
    """Of centre and radius (3, 3); wider by the residuals over the sensor's sigma where those are larger."""
    covariance = SYSTEMATIC_SIGMA_M**2 * np.eye(3)
    covariance += np.linalg.inv(information) * max(1.0, scale**2)
    return covariance


@compiled
def _add_direction(information: Floats, gradient: Floats, weighted_left: Floats, centre_m: Floats) -> None:
    """Put in that the axis, at centre_m (2,) from the sensor, is behind the middle between the edges; weighted_left
    (2,): to the left of there, over the 1-sigma."""
    across = weighted_left[0] * centre_m[0] + weighted_left[1] * centre_m[1]
    for one in range(2):
        gradient[one] += weighted_left[one] * across
        for other in range(2):
            information[one, other] += weighted_left[one] * weighted_left[other]


@compiled
def _edges_sigma_rad(width_rad: Floats, step_rad: float) -> float:
    """1-sigma of a width by where beams happen to fall on its edges."""
    ordered = np.sort(width_rad)
    count = len(ordered)
    spread_rad = 0.74 * (ordered[(3 * count) // 4] - ordered[count // 4])
    return float(max(step_rad / np.sqrt(6.0), spread_rad) / np.sqrt(count))


@compiled
def _radius(width_rad: Floats, step_rad: float, edges_rad: float, away_m: float) -> tuple[float, float]:
    """The radius in m that an object covers and its 1-sigma.

    Lines of sight that touch a cylinder do so beyond its front. Beams fall at random on the two edges, alike for no two
    rings; they touch an object early, alike for all rings, by nothing to their full width.
    """
    sigma_rad = np.hypot(edges_rad, DIVERGENCE_RAD / np.sqrt(12.0))
    covered = np.sin(0.5 * min(max(np.median(width_rad) + step_rad - 0.5 * DIVERGENCE_RAD, 0.0), 1.0))
    return away_m * covered / (1.0 - MEAN_DEPTH * covered), 0.5 * np.hypot(away_m * sigma_rad, SYSTEMATIC_SIGMA_M)


@compiled
def _normal_equations(point_m: Floats, state: Floats, sigma_m: float) -> tuple[Floats, Floats]:
    """Information (3, 3) and gradient (3,) of the points' distances from the circle, with Huber's weights."""
    information, gradient, derivative = np.zeros((3, 3)), np.zeros(3), np.empty(3)
    for row in range(len(point_m)):
        x, y = point_m[row, 0] - state[0], point_m[row, 1] - state[1]
        distance = max(np.sqrt(x * x + y * y), 1e-9)
        residual = distance - state[2]
        weight = 1.0 / (sigma_m**2 * max(1.0, abs(residual) / (2.0 * sigma_m)))
        derivative[0], derivative[1], derivative[2] = -x / distance, -y / distance, -1.0
        for one in range(3):
            gradient[one] += weight * derivative[one] * residual
            for other in range(3):
                information[one, other] += weight * derivative[one] * derivative[other]
    return information, gradient

"""The factors gtsam does not have: odometry with calibration, a fix at a lever arm, a sighting through a sensor with
calibration, an anchor in an image.

Each function returns one `gtsam.CustomFactor` whose Jacobians are analytic; gtsam's Pose2 increments are in the
body frame: x, y in m, heading in rad.
"""

import math
from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.poses import wrap_angle_rad

Floats = NDArray[np.float64]
Jacobians = list[Floats] | None
MIN_DISTANCE_M = 0.2  # nearer than this a sighting's logarithm and bearing have no usable derivative


def odometry_factor(
    keys: tuple[int, int, int, int],
    delta: Floats,
    derivative: Floats,
    *,
    reference: Floats,
    covariance: Floats,
    by_scale_units: bool = True,
) -> gtsam.CustomFactor:
    """Motion from keyframe keys[0] to keys[1] as the wheels tell it under keys[2] (3,): speed scale, turn scale,
    delay, and turn bias keys[3] (1,).

    delta (3,) was integrated at the calibration `reference` (4,); derivative (3, 4) is its derivative there
    (Forster et al. 2017, first-order bias correction, in SE(2)). The residual is divided by the scales: taken in
    map units, many noisy odometry residuals would shrink the map through the scale states. Where fixes outweigh the
    odometry, which is what errors of a radian a minute mean, the division would instead stretch the scales:
    `by_scale_units` off leaves it away.
    """
    key_from, key_to, key_scale, key_bias = keys
    by_scale, by_bias = -derivative[:, :3], -derivative[:, 3:]
    rows = np.column_stack([derivative, delta - derivative @ reference]).tolist()  # plain floats: called very often

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: Jacobians) -> Floats:
        start, end = values.atPose2(key_from), values.atPose2(key_to)
        speed, turn, delay = values.atVector(key_scale).tolist()
        bias = float(values.atVector(key_bias)[0])
        expected = [r[0] * speed + r[1] * turn + r[2] * delay + r[3] * bias + r[4] for r in rows]
        heading = start.theta()
        c, s = math.cos(heading), math.sin(heading)
        east, north = end.x() - start.x(), end.y() - start.y()
        ahead, left = c * east + s * north, c * north - s * east
        turned = end.theta() - heading
        off_rad = wrap_angle_rad(turned - expected[2])
        u, w = (1.0 / speed, 1.0 / turn) if by_scale_units else (1.0, 1.0)
        residual = np.array(((ahead - expected[0]) * u, (left - expected[1]) * u, off_rad * w))
        if jacobians is not None:
            ct, st = math.cos(turned) * u, math.sin(turned) * u
            unit = np.array([[u], [u], [w]])
            jacobians[0] = np.array([[-u, 0.0, left * u], [0.0, -u, -ahead * u], [0.0, 0.0, -w]])
            jacobians[1] = np.array([[ct, -st, 0.0], [st, ct, 0.0], [0.0, 0.0, w]])
            jacobians[2] = unit * by_scale
            if by_scale_units:
                jacobians[2][:2, 0] -= residual[:2] * u
                jacobians[2][2, 1] -= residual[2] * w
            jacobians[3] = unit * by_bias
        return residual

    return gtsam.CustomFactor(gtsam.noiseModel.Gaussian.Covariance(covariance), list(keys), error)


def fix_factor(
    keys: tuple[int, ...],
    fix_m: Floats,
    *,
    T_keyframe_base: Floats,
    bias_weight: tuple[float, float],
    noise: gtsam.noiseModel.Base,
) -> gtsam.CustomFactor:
    """A fix (2,) in the map against the antenna at lever arm keys[1] (2,) of the base at the fix's time.

    keys: keyframe, lever arm and, if the receiver's slow error is a state, its two neighbouring knots (2,) each
    with weights `bias_weight`. T_keyframe_base (3,): the base at the fix's time in the keyframe's frame.
    """
    x_m, y_m, turned = T_keyframe_base
    turn = np.array([[math.cos(turned), -math.sin(turned)], [math.sin(turned), math.cos(turned)]])
    weights = bias_weight[: len(keys) - 2]

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: Jacobians) -> Floats:
        pose = values.atPose2(keys[0])
        arm = turn @ values.atVector(keys[1])
        ahead, left = x_m + arm[0], y_m + arm[1]
        c, s = math.cos(pose.theta()), math.sin(pose.theta())
        rotation = np.array([[c, -s], [s, c]])
        predicted = np.array([pose.x() + c * ahead - s * left, pose.y() + s * ahead + c * left])
        for key, weight in zip(keys[2:], weights, strict=True):
            predicted = predicted + weight * values.atVector(key)
        if jacobians is not None:
            jacobians[0] = np.column_stack([rotation, rotation @ (-left, ahead)])
            jacobians[1] = rotation @ turn
            for position, weight in enumerate(weights):
                jacobians[2 + position] = weight * np.eye(2)
        return predicted - fix_m

    return gtsam.CustomFactor(noise, list(keys), error)


def decay_factor(key_from: int, key_to: int, *, decay: float, sigma_m: float, size: int) -> gtsam.CustomFactor:
    """A Gauss-Markov step: the state (size,) at key_to is `decay` times that at key_from, plus noise sigma_m."""

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: Jacobians) -> Floats:
        if jacobians is not None:
            jacobians[0] = -decay * np.eye(size)
            jacobians[1] = np.eye(size)
        step: Floats = values.atVector(key_to) - decay * values.atVector(key_from)
        return step

    return gtsam.CustomFactor(gtsam.noiseModel.Isotropic.Sigma(size, sigma_m), [key_from, key_to], error)


def anchor_factor(keys: tuple[int, ...], label_m: Floats, *, noise: gtsam.noiseModel.Base) -> gtsam.CustomFactor:
    """A label (2,) in the map against landmark keys[0] plus, if there is one, its image's offset keys[1] (2,)."""

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: Jacobians) -> Floats:
        predicted: Floats = values.atPoint2(keys[0])
        if len(keys) > 1:
            predicted = predicted + values.atVector(keys[1])
        if jacobians is not None:
            for position in range(len(keys)):
                jacobians[position] = np.eye(2)
        return predicted - label_m

    return gtsam.CustomFactor(noise, list(keys), error)


def point_factor(
    keys: tuple[int, int, int], point_m: Floats, *, by_offset: Floats, noise: gtsam.noiseModel.Base
) -> gtsam.CustomFactor:
    """A point (2,) as seen in the frame of keyframe keys[0], against where the point keys[2] (2,) is in the map.

    keys[1] (k,) is what perception is off by in all its sights; by_offset (2, k) moves the seen point by it. Residual:
    x and y in m in the keyframe's frame. In plain numbers, not arrays: there are tens of thousands of these.
    """
    seen_x, seen_y = point_m.tolist()
    by_x, by_y = by_offset.tolist()

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: Jacobians) -> Floats:
        pose = values.atPose2(keys[0])
        x, y = values.atPoint2(keys[2]).tolist()
        heading = pose.theta()
        c, s = math.cos(heading), math.sin(heading)
        east, north = x - pose.x(), y - pose.y()
        ahead, left = c * east + s * north, c * north - s * east
        if jacobians is not None:
            jacobians[0] = np.array(((-1.0, 0.0, left), (0.0, -1.0, -ahead)))
            jacobians[1] = by_offset
            jacobians[2] = np.array(((c, s), (-s, c)))
        offset = values.atVector(keys[1]).tolist()
        for k, value in enumerate(offset):
            ahead += by_x[k] * value
            left += by_y[k] * value
        return np.array((ahead - seen_x, left - seen_y))

    return gtsam.CustomFactor(noise, list(keys), error)


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """One sighting: ln_range of what the sensor said in map metres, its bearing, and the bearing squared less the
    drive's mean of it. T_keyframe_sensor (3,); target_m (2,): what was seen, in the frame of the keyframe it hangs
    on, where it is no landmark."""

    ln_range: float
    bearing_rad: float
    centred_square_rad2: float
    T_keyframe_sensor: Floats
    target_m: Floats | None


def sighting_factor(
    keys: tuple[int, int, int], measured: Measured, *, noise: gtsam.noiseModel.Base
) -> gtsam.CustomFactor:
    """What the sensor on keyframe keys[0] saw of the landmark, or of the other vehicle's keyframe, keys[2].

    keys[1] (6,) is the sensor's calibration: ln range = ln distance + k0 + k1 b + k2 (b^2 - mean b^2), the sensor k3
    ahead of where it is said to be, bearing b = true bearing + k4 + k5 b. A camera tells depth by the size of
    things, so its error is in proportion to the range and grows off the axis. Residual: ln range, bearing in rad.
    In plain numbers, not arrays: there are tens of thousands of these.
    """
    x_m, y_m, turned = measured.T_keyframe_sensor.tolist()
    cs, ss = math.cos(turned), math.sin(turned)
    bearing, square = measured.bearing_rad, measured.centred_square_rad2
    target = None if measured.target_m is None else measured.target_m.tolist()

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: Jacobians) -> Floats:
        pose = values.atPose2(keys[0])
        k0, k1, k2, k3, k4, k5 = values.atVector(keys[1]).tolist()
        seen_x, seen_y, seen_c, seen_s = _seen(values, keys[2], target)
        heading = pose.theta()
        c, s = math.cos(heading), math.sin(heading)
        east, north = seen_x - pose.x(), seen_y - pose.y()
        ahead, left = c * east + s * north, c * north - s * east
        x = cs * (ahead - x_m) + ss * (left - y_m) - k3
        y = cs * (left - y_m) - ss * (ahead - x_m)
        square_m2 = max(x * x + y * y, MIN_DISTANCE_M**2)
        if jacobians is not None:
            gx, gy = x / square_m2, y / square_m2
            rows = (gx * cs - gy * ss, gx * ss + gy * cs), (-gy * cs - gx * ss, gx * cs - gy * ss)
            jacobians[0] = np.array([(-p, -q, p * left - q * ahead) for p, q in rows])
            jacobians[1] = np.array([(1.0, bearing, square, -gx, 0.0, 0.0), (0.0, 0.0, 0.0, gy, 1.0, bearing)])
            in_map = [(p * c - q * s, p * s + q * c) for p, q in rows]
            jacobians[2] = _by_seen(in_map, target, seen_c, seen_s)
        expected = 0.5 * math.log(square_m2) + k0 + k1 * bearing + k2 * square
        off = wrap_angle_rad(math.atan2(y, x) + k4 + (k5 - 1.0) * bearing)
        return np.array((expected - measured.ln_range, off))

    return gtsam.CustomFactor(noise, list(keys), error)


def _seen(values: gtsam.Values, key: int, target: list[float] | None) -> tuple[float, float, float, float]:
    """x and y in the map of a landmark, or of a point in a keyframe's frame, with that frame's cosine and sine."""
    if target is None:
        x, y = values.atPoint2(key).tolist()
        return x, y, 1.0, 0.0
    pose = values.atPose2(key)
    c, s = math.cos(pose.theta()), math.sin(pose.theta())
    return pose.x() + c * target[0] - s * target[1], pose.y() + s * target[0] + c * target[1], c, s


def _by_seen(in_map: list[tuple[float, float]], target: list[float] | None, c: float, s: float) -> Floats:
    """Derivatives by what was seen, from those by its place in the map: a landmark, or a pose with cosine and sine."""
    if target is None:
        return np.array(in_map)
    own = [(p * c + q * s, q * c - p * s) for p, q in in_map]
    return np.array([(p, q, q * target[0] - p * target[1]) for p, q in own])

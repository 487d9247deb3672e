"""The factor graph of a fleet: odometry, calibrations, fixes, landmarks and anchors, each pulling what it claims."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.typing import NDArray

from trigpoint_optimisation.core.factors import (
    Measured,
    anchor_factor,
    decay_factor,
    fix_factor,
    odometry_factor,
    point_factor,
    sighting_factor,
)
from trigpoint_optimisation.core.odometry import OdometryCalibration, TurnSource
from trigpoint_optimisation.core.preparation import PreparedDrive
from trigpoint_optimisation.core.sightings import Sightings
from trigpoint_optimisation.core.single_sightings import SingleSightings
from trigpoint_optimisation.core.state import (
    RANGE_OFFSETS,
    antenna_key,
    fix_bias_key,
    image_key,
    landmark_key,
    pose_key,
    range_offset_key,
    scale_key,
    sensor_key,
    track_key,
    turn_bias_key,
)
from trigpoint_optimisation.settings import CalibrationPriors, FixSettings, Kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

KNOWN_SIGMA = 1e-3  # of calibration states that are held, in their own units
MIN_RANGE_M = 0.2  # a sighting closer than this to the base's origin has no usable bearing


@dataclass(frozen=True, slots=True, kw_only=True)
class TiedLabels:
    """Labels (l,) tied to landmarks: landmark (l,), label_m (l, 2), sigma_m (l,), image (l,) or -1;
    image_sigma_m (k,) prior of each image's offset."""

    landmark: Ints
    label_m: Floats
    sigma_m: Floats
    image: Ints
    image_sigma_m: Floats


def with_kernel(noise: gtsam.noiseModel.Base, kernel: Kernel | None) -> gtsam.noiseModel.Base:
    """The noise under a kernel, or as it is."""
    if kernel is None:
        return noise
    estimators = gtsam.noiseModel.mEstimator
    if kernel.kind == "dcs":  # its parameter is a chi-square
        return gtsam.noiseModel.Robust.Create(estimators.DCS.Create(kernel.sigmas**2), noise)
    return gtsam.noiseModel.Robust.Create(estimators.Cauchy.Create(kernel.sigmas), noise)


def _calibration_vector(calibration: OdometryCalibration, knot: int) -> Floats:
    return np.array([calibration.speed_scale, calibration.turn_scale, calibration.delay_s, calibration.turn_bias[knot]])


def add_motions(graph: gtsam.NonlinearFactorGraph, prepared: PreparedDrive) -> None:
    """The odometry between neighbouring keyframes."""
    motions, d = prepared.motions, prepared.index
    for k in range(len(motions.delta)):
        knot = int(motions.bias_index[k])
        graph.add(
            odometry_factor(
                (pose_key(d, k), pose_key(d, k + 1), scale_key(d), turn_bias_key(d, knot)),
                motions.delta[k],
                motions.derivative[k],
                reference=_calibration_vector(prepared.calibration, knot),
                covariance=motions.covariance[k],
                by_scale_units=prepared.source is not TurnSource.SAMPLED_WHEELS,
            )
        )


def scale_sigmas(prepared: PreparedDrive, priors: CalibrationPriors) -> Floats:
    """1-sigma (3,) of speed scale, turn scale and delay in s by what the drive's odometry and sensor are."""
    speed = {
        TurnSource.COMMAND: priors.speed_scale_command,
        TurnSource.SAMPLED_WHEELS: priors.speed_scale_sampled,
    }.get(prepared.source, priors.speed_scale)
    delay = priors.delay_camera_s if prepared.camera else priors.delay_s
    if prepared.source is TurnSource.SAMPLED_WHEELS:
        delay = priors.delay_sampled_s
    return np.array([speed, turn_sigmas(prepared.source, priors)[0], delay])


def sensor_sigmas(prepared: PreparedDrive, priors: CalibrationPriors) -> Floats:
    """1-sigma (6,) of the landmark sensor's calibration, see `sighting_factor`; a lidar's is known."""
    if not prepared.camera:
        return np.full(6, KNOWN_SIGMA)
    return np.array(
        [
            priors.camera_range,
            priors.camera_range_per_rad,
            priors.camera_range_per_rad2,
            priors.camera_ahead_m,
            priors.camera_bearing_rad,
            priors.camera_bearing_scale,
        ]
    )


def turn_sigmas(source: TurnSource, priors: CalibrationPriors) -> tuple[float, float]:
    """1-sigma of turn scale and of turn bias (rad, rad/s or rad/m) by where the yaw rate comes from."""
    match source:
        case TurnSource.IMU:
            return priors.turn_scale_imu, priors.turn_bias_imu_radps
        case TurnSource.STEERING:
            return priors.turn_scale_steering, priors.turn_bias_steering_rad
        case TurnSource.COMMAND:
            return priors.turn_scale_command, priors.turn_bias_command_radpm
        case TurnSource.SAMPLED_WHEELS:
            return priors.turn_scale_wheels, priors.turn_bias_sampled_radpm
        case _:
            return priors.turn_scale_wheels, priors.turn_bias_wheels_radpm


def add_calibration_priors(
    graph: gtsam.NonlinearFactorGraph, prepared: PreparedDrive, priors: CalibrationPriors, *, point_scale: float
) -> None:
    """Every calibration state held at its nominal value with its prior sigma; turn bias as a random walk."""
    d, arm_m = prepared.index, prepared.nominal_antenna_m(point_scale)
    turn_bias = turn_sigmas(prepared.source, priors)[1]
    sigmas = scale_sigmas(prepared, priors)
    diagonal = gtsam.noiseModel.Diagonal.Sigmas
    graph.add(gtsam.PriorFactorVector(scale_key(d), np.array([point_scale, 1.0, 0.0]), diagonal(sigmas)))
    graph.add(gtsam.PriorFactorVector(antenna_key(d), arm_m, diagonal(np.full(2, priors.antenna_m))))
    graph.add(gtsam.PriorFactorVector(sensor_key(d), np.zeros(6), diagonal(sensor_sigmas(prepared, priors))))
    offset = gtsam.noiseModel.Isotropic.Sigma(RANGE_OFFSETS, priors.range_offset_m)
    graph.add(gtsam.PriorFactorVector(range_offset_key(d), np.zeros(RANGE_OFFSETS), offset))
    graph.add(gtsam.PriorFactorVector(turn_bias_key(d, 0), np.zeros(1), diagonal(np.array([turn_bias]))))
    by_imu = prepared.source is TurnSource.IMU
    fraction = priors.turn_bias_walk_fraction_imu if by_imu else priors.turn_bias_walk_fraction
    walk = turn_bias * fraction * math.sqrt(priors.turn_bias_knot_s / 60.0)
    for knot in range(1, len(prepared.calibration.turn_bias)):
        keys = turn_bias_key(d, knot - 1), turn_bias_key(d, knot)
        graph.add(decay_factor(*keys, decay=1.0, sigma_m=walk, size=1))


def fix_bias_stamps(prepared: PreparedDrive, fixes: FixSettings) -> Ints:
    """Stamps (g,) of the knots of the slow fix error, a third of its time apart; none if it is no state."""
    if fixes.bias_sigma_m <= 0.0 or not prepared.fix_usable.any():
        return np.zeros(0, dtype=np.int64)
    step_ns = round(fixes.bias_time_s / 3.0 * 1e9)
    usable = prepared.drive.fixes.stamp_ns[prepared.fix_usable]
    return np.arange(int(usable[0]), int(usable[-1]) + 2 * step_ns, step_ns, dtype=np.int64)


def chosen_fixes(prepared: PreparedDrive, allowed: Bools, *, spacing_m: float) -> Ints:
    """The first allowed fix (indices) of every `spacing_m` of path."""
    rows = np.nonzero(allowed & prepared.fix_usable)[0]
    cell = np.floor(prepared.fix_path_m[rows] / spacing_m)
    return rows[np.unique(cell, return_index=True)[1]]


def add_fix_bias(graph: gtsam.NonlinearFactorGraph, d: int, knot_ns: Ints, fixes: FixSettings) -> None:
    """The slow error of a drive's fixes as a Gauss-Markov sequence."""
    if not len(knot_ns):
        return
    first = gtsam.noiseModel.Isotropic.Sigma(2, fixes.bias_sigma_m)
    graph.add(gtsam.PriorFactorVector(fix_bias_key(d, 0), np.zeros(2), first))
    decay = math.exp(-float(knot_ns[1] - knot_ns[0]) * 1e-9 / fixes.bias_time_s) if len(knot_ns) > 1 else 0.0
    sigma_m = fixes.bias_sigma_m * math.sqrt(1.0 - decay**2)
    for knot in range(len(knot_ns) - 1):
        graph.add(decay_factor(fix_bias_key(d, knot), fix_bias_key(d, knot + 1), decay=decay, sigma_m=sigma_m, size=2))


def add_fixes(
    graph: gtsam.NonlinearFactorGraph, prepared: PreparedDrive, rows: Ints, *, fixes: FixSettings, robust: bool
) -> None:
    """Edges from the chosen fixes (indices) to the map's origin."""
    d, knot_ns = prepared.index, fix_bias_stamps(prepared, fixes)
    add_fix_bias(graph, d, knot_ns, fixes)
    noise = with_kernel(gtsam.noiseModel.Isotropic.Sigma(2, fixes.sigma_m), fixes.kernel if robust else None)
    for row in rows:
        keys = [pose_key(d, int(prepared.fix_keyframe[row])), antenna_key(d)]
        weight = (0.0, 0.0)
        if len(knot_ns) > 1:
            place = float(prepared.drive.fixes.stamp_ns[row] - knot_ns[0]) / float(knot_ns[1] - knot_ns[0])
            knot = min(int(place), len(knot_ns) - 2)
            weight = (1.0 - (place - knot), place - knot)
            keys += [fix_bias_key(d, knot), fix_bias_key(d, knot + 1)]
        offset = prepared.fix_offset[row]
        graph.add(fix_factor(tuple(keys), prepared.fix_m[row], T_keyframe_base=offset, bias_weight=weight, noise=noise))


def add_sightings(
    graph: gtsam.NonlinearFactorGraph, sightings: Sightings, landmark: Ints, *, kernel: Kernel | None
) -> None:
    """Bearing and range from keyframe to landmark; `landmark` (s,) by sighting, negative ones left out.

    Those of perceived landmarks are of their track's own point, which is off the landmark by the error they share, and
    as far off in range as their drive's offset says.
    """
    x, y = sightings.point_m.T
    range_m = np.hypot(x, y)
    rows = np.nonzero((landmark >= 0) & (range_m > MIN_RANGE_M))[0]
    to_polar = np.stack([np.stack([-y / range_m**2, x / range_m**2], -1), np.stack([x / range_m, y / range_m], -1)], -2)
    covariance = to_polar @ sightings.covariance @ to_polar.transpose(0, 2, 1)
    bearing = np.arctan2(y, x)
    for row in rows:
        d, pose = int(sightings.drive[row]), pose_key(int(sightings.drive[row]), int(sightings.keyframe[row]))
        if sightings.shared_m2[row] > 0.0:
            noise = with_kernel(gtsam.noiseModel.Gaussian.Covariance(sightings.covariance[row]), kernel)
            keys = pose, range_offset_key(d), track_key(int(sightings.track[row]))
            graph.add(point_factor(keys, sightings.point_m[row], by_offset=sightings.by_offset[row], noise=noise))
            continue
        noise = with_kernel(gtsam.noiseModel.Gaussian.Covariance(covariance[row]), kernel)
        seen = landmark_key(int(landmark[row]))
        graph.add(gtsam.BearingRangeFactor2D(pose, seen, gtsam.Rot2(bearing[row]), range_m[row], noise))
    _add_shared_errors(graph, sightings, landmark, kernel=kernel)


def _add_shared_errors(
    graph: gtsam.NonlinearFactorGraph, sightings: Sightings, landmark: Ints, *, kernel: Kernel | None
) -> None:
    """Each track's own point at its landmark, as surely as the error that the track's sightings share is small."""
    rows = np.nonzero((landmark >= 0) & (sightings.shared_m2 > 0.0))[0]
    tracks, first, number = np.unique(sightings.track[rows], return_index=True, return_inverse=True)
    variance_m2 = np.bincount(number, weights=sightings.shared_m2[rows]) / np.maximum(np.bincount(number), 1)
    for track, row, variance in zip(tracks, rows[first], variance_m2, strict=True):
        noise = with_kernel(gtsam.noiseModel.Isotropic.Variance(2, variance), kernel)
        keys = landmark_key(int(landmark[row])), track_key(int(track))
        graph.add(gtsam.BetweenFactorPoint2(*keys, np.zeros(2), noise))


def add_single_sightings(
    graph: gtsam.NonlinearFactorGraph, sightings: SingleSightings, *, kernel: Kernel | None
) -> None:
    """Every sighting of a landmark by a camera, and of another vehicle's keyframe, through the sensor's calibration."""
    for row, (d, landmark) in enumerate(zip(sightings.drive, sightings.landmark, strict=True)):
        of_landmark = landmark >= 0
        measured = Measured(
            ln_range=float(sightings.ln_range[row]),
            bearing_rad=float(sightings.bearing_rad[row]),
            centred_square_rad2=float(sightings.centred_square_rad2[row]),
            T_keyframe_sensor=sightings.T_keyframe_sensor[row],
            target_m=None if of_landmark else sightings.target_m[row],
        )
        if of_landmark:
            seen = landmark_key(int(landmark))
        else:
            seen = pose_key(int(sightings.seen_drive[row]), int(sightings.seen_keyframe[row]))
        keys = pose_key(int(d), int(sightings.keyframe[row])), sensor_key(int(d)), seen
        noise = with_kernel(gtsam.noiseModel.Diagonal.Sigmas(sightings.sigma[row]), kernel)
        graph.add(sighting_factor(keys, measured, noise=noise))


def add_labels(graph: gtsam.NonlinearFactorGraph, labels: TiedLabels) -> None:
    """Anchors: labels tied to landmarks, through their image's offset where they have an image."""
    for i, sigma_m in enumerate(labels.image_sigma_m):
        graph.add(gtsam.PriorFactorVector(image_key(i), np.zeros(2), gtsam.noiseModel.Isotropic.Sigma(2, sigma_m)))
    for row, landmark in enumerate(labels.landmark):
        keys = [landmark_key(int(landmark))]
        if labels.image[row] >= 0:
            keys.append(image_key(int(labels.image[row])))
        noise = gtsam.noiseModel.Isotropic.Sigma(2, labels.sigma_m[row])
        graph.add(anchor_factor(tuple(keys), labels.label_m[row], noise=noise))


def fleet_graph(
    prepared: Sequence[PreparedDrive], priors: CalibrationPriors, *, point_scale: float
) -> gtsam.NonlinearFactorGraph:
    """The graph of what every solve has: odometry and calibration priors of all drives."""
    graph = gtsam.NonlinearFactorGraph()
    for each in prepared:
        add_motions(graph, each)
        add_calibration_priors(graph, each, priors, point_scale=point_scale)
    return graph

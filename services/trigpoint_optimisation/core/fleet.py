"""All drives of a solve, ready for the graph, and the states they are solved for."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import gtsam
import numpy as np
from numpy.typing import NDArray

from trigpoint.events.drives import Drive
from trigpoint.geodesy.poses import transform_points
from trigpoint.geodesy.projection import MapFrame
from trigpoint_optimisation.core.detection_noise import DetectionNoise, nominal_noise
from trigpoint_optimisation.core.fix_noise import measured_fix_settings
from trigpoint_optimisation.core.gauss_newton import MAX_ITERATIONS, solved
from trigpoint_optimisation.core.graph import add_fixes, chosen_fixes, fix_bias_stamps, fleet_graph
from trigpoint_optimisation.core.loops import add_loops
from trigpoint_optimisation.core.odometry import OdometryCalibration
from trigpoint_optimisation.core.preparation import PreparedDrive, nominal_calibration, prepared_drive
from trigpoint_optimisation.core.relative_poses import (
    add_relative_poses,
    between_keyframes,
    hung_motions,
    scaled,
)
from trigpoint_optimisation.core.sightings import keyframe_points
from trigpoint_optimisation.core.state import DriveState, MapState, shared_keys, state_of, values_of
from trigpoint_optimisation.settings import FixSettings, SolveSettings

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fleet:
    """The drives of a solve. `trusted` (f,) per drive: fixes that may enter the graph; `fixes` and `noise`: how noisy
    fixes and landmark detections are."""

    frame: MapFrame
    settings: SolveSettings
    prepared: tuple[PreparedDrive, ...]
    trusted: tuple[Bools, ...]
    fixes: tuple[FixSettings, ...]
    noise: tuple[DetectionNoise, ...]


def prepared_fleet(
    drives: Sequence[Drive], frame: MapFrame, settings: SolveSettings, *, allowed: Sequence[Bools]
) -> Fleet:
    """The fleet at nominal calibration; `allowed` (f,) per drive says which fixes may be used at all."""
    prepared = tuple(
        prepared_drive(
            drive,
            frame,
            settings,
            index=index,
            calibration=nominal_calibration(drive, settings.calibration, point_scale=frame.point_scale),
        )
        for index, drive in enumerate(drives)
    )
    trusted = tuple(mask & each.fix_usable for mask, each in zip(allowed, prepared, strict=True))
    return Fleet(
        frame=frame,
        settings=settings,
        prepared=prepared,
        trusted=trusted,
        fixes=(settings.fixes,) * len(prepared),
        noise=(nominal_noise(settings.detections),) * len(prepared),
    )


def nominal_state(fleet: Fleet, pose: Sequence[Floats]) -> MapState:
    """The drives' nominal states at the given keyframe poses (n, 3) each; no landmarks, no images."""
    scale = fleet.frame.point_scale
    return MapState(
        drives=tuple(
            DriveState(
                pose=poses,
                scale=np.array([scale, 1.0, 0.0]),
                turn_bias=np.zeros(len(each.calibration.turn_bias)),
                antenna_m=each.nominal_antenna_m(scale),
                fix_bias_m=_no_fix_bias(each, fixes),
                sensor=np.zeros(6),
            )
            for each, poses, fixes in zip(fleet.prepared, pose, fleet.fixes, strict=True)
        ),
        landmark_m=np.zeros((0, 2)),
        image_m=np.zeros((0, 2)),
    )


def with_poses(state: MapState, pose: Sequence[Floats]) -> MapState:
    """The state with other keyframe poses."""
    drives = tuple(replace(drive, pose=poses) for drive, poses in zip(state.drives, pose, strict=True))
    return replace(state, drives=drives)


def recalibrated(fleet: Fleet, state: MapState) -> Fleet:
    """The fleet with its motions integrated anew at the state's calibration."""
    prepared = []
    for each, drive in zip(fleet.prepared, state.drives, strict=True):
        calibration = OdometryCalibration(
            speed_scale=float(drive.scale[0]),
            turn_scale=float(drive.scale[1]),
            delay_s=float(drive.scale[2]),
            bias_stamp_ns=each.calibration.bias_stamp_ns,
            turn_bias=drive.turn_bias,
        )
        anew = prepared_drive(
            each.drive,
            fleet.frame,
            fleet.settings,
            index=each.index,
            calibration=calibration,
            keyframe_ns=each.stamp_ns,
        )
        prepared.append(replace(anew, fix_usable=each.fix_usable, detection_usable=each.detection_usable))
    return replace(fleet, prepared=tuple(prepared))


def without_fix_bias(fleet: Fleet, state: MapState) -> MapState:
    """The state with the slow error of fixes at zero, at as many knots as the fleet's fixes have."""
    drives = tuple(
        replace(drive, fix_bias_m=_no_fix_bias(each, fixes))
        for each, drive, fixes in zip(fleet.prepared, state.drives, fleet.fixes, strict=True)
    )
    return replace(state, drives=drives)


def _no_fix_bias(prepared: PreparedDrive, fixes: FixSettings) -> Floats:
    return np.zeros((len(fix_bias_stamps(prepared, fixes)), 2))


def with_measured_fixes(fleet: Fleet, state: MapState) -> tuple[Fleet, MapState]:
    """The fleet with the noise of each drive's fixes as its residuals show it, and the state resized for it."""
    fixes = tuple(
        measured_fix_settings(each, drive, trusted, own)
        for each, drive, trusted, own in zip(fleet.prepared, state.drives, fleet.trusted, fleet.fixes, strict=True)
    )
    fleet = replace(fleet, fixes=fixes)
    return fleet, without_fix_bias(fleet, state)


def motion_graph(fleet: Fleet) -> gtsam.NonlinearFactorGraph:
    """Odometry, by wheels and by matched points, closed loops, and calibration priors of the whole fleet."""
    scale, matched = fleet.frame.point_scale, fleet.settings.matched
    graph = fleet_graph(fleet.prepared, fleet.settings.calibration, point_scale=scale)
    for each in fleet.prepared if matched.used else ():
        motions = between_keyframes(each, each.drive.matched)
        relative = hung_motions(each, each, motions, point_scale=scale)
        add_relative_poses(graph, scaled(relative, matched.covariance_factor), kernel=matched.kernel)
    add_loops(graph, fleet.prepared, fleet.settings.loops, point_scale=scale)
    return graph


def georeferenced_graph(fleet: Fleet, *, robust: bool) -> gtsam.NonlinearFactorGraph:
    """Odometry, calibration priors and the edges of trusted fixes."""
    graph = motion_graph(fleet)
    for each, trusted, fixes in zip(fleet.prepared, fleet.trusted, fleet.fixes, strict=True):
        rows = chosen_fixes(each, trusted, spacing_m=fixes.spacing_m)
        add_fixes(graph, each, rows, fixes=fixes, robust=robust)
    return graph


def solved_state(
    graph: gtsam.NonlinearFactorGraph, state: MapState, *, max_iterations: int = MAX_ITERATIONS
) -> MapState:
    """The state at the minimum of the graph's cost nearest to `state`."""
    values = values_of(state)
    return state_of(solved(graph, values, last=shared_keys(values), max_iterations=max_iterations), state)


def detections_in_map(fleet: Fleet, state: MapState) -> tuple[Floats, ...]:
    """Every drive's detected points (d, 2) in the map as its keyframes place them."""
    return tuple(
        transform_points(
            drive.pose[each.detection_keyframe], keyframe_points(each, point_scale=fleet.frame.point_scale)
        )
        for each, drive in zip(fleet.prepared, state.drives, strict=True)
    )

"""The local map as one rigid body, brought onto its fixes by a single SE(2) motion."""

import math
from dataclasses import dataclass, replace

import gtsam
import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import AlignmentRefused
from trigpoint.geodesy.poses import transform_points, wrap_angles_rad
from trigpoint_optimisation.core.alignment import RigidAlignment, rigid_alignment
from trigpoint_optimisation.core.fleet import Fleet, motion_graph, solved_state
from trigpoint_optimisation.core.graph import add_sightings, add_single_sightings
from trigpoint_optimisation.core.placing import FIX_SIGMA_M
from trigpoint_optimisation.core.sightings import Sightings
from trigpoint_optimisation.core.single_sightings import SingleSightings
from trigpoint_optimisation.core.state import MapState, pose_key

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SLOW_TIME_S = 300.0  # fixes this close in time share their slow error


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """Everything a fleet saw: averaged sightings with the `landmark` (s,) each is of, and single ones."""

    sightings: Sightings
    landmark: Ints
    singles: SingleSightings

    def seers(self) -> Ints:
        """(drive, landmark) of every sighting of a landmark (k, 2), without repetition."""
        averaged = np.column_stack([self.sightings.drive, self.landmark])
        pairs = np.concatenate([averaged, np.column_stack([self.singles.drive, self.singles.landmark])])
        return np.unique(pairs[pairs[:, 1] >= 0], axis=0)

    def links(self) -> list[set[int]]:
        """Sets of drives that see one landmark, or one the other."""
        seers, of_vehicle = self.seers(), self.singles.seen_drive >= 0
        common = [{int(d) for d in seers[seers[:, 1] == number, 0]} for number in np.unique(seers[:, 1])]
        met = zip(self.singles.drive[of_vehicle], self.singles.seen_drive[of_vehicle], strict=True)
        return common + [{int(one), int(other)} for one, other in set(met)]


def connected_drives(seen: Seen, drive_count: int) -> tuple[tuple[int, ...], ...]:
    """Groups of drives that see common landmarks or one another, directly or through others."""
    group = list(range(drive_count))
    for linked in seen.links():
        joined = {group[drive] for drive in linked}
        group = [min(joined) if own in joined else own for own in group]
    return tuple(tuple(d for d in range(drive_count) if group[d] == name) for name in sorted(set(group)))


def rigid_state(fleet: Fleet, state: MapState, seen: Seen) -> MapState:
    """The state solved from odometry and landmarks alone, each connected group then moved onto its fixes as one.

    Raises AlignmentRefused for a group whose path is nearly straight or stationary.
    """
    groups = connected_drives(seen, len(fleet.prepared))
    bare = replace(
        state,
        drives=tuple(replace(drive, fix_bias_m=np.zeros((0, 2))) for drive in state.drives),
        image_m=np.zeros((0, 2)),
    )
    local = solved_state(rigid_graph(fleet, bare, seen), bare)
    for group in groups:
        local = _moved(local, group, _group_alignment(fleet, local, group), seen)
    return local


def rigid_graph(fleet: Fleet, state: MapState, seen: Seen) -> gtsam.NonlinearFactorGraph:
    """Odometry and landmarks, each connected group held where the state has it, as surely as its fixes could say."""
    graph = motion_graph(fleet)
    add_sightings(graph, seen.sightings, seen.landmark, kernel=fleet.settings.fixes.landmark_kernel)
    add_single_sightings(graph, seen.singles, kernel=fleet.settings.detections.single_kernel)
    for group in connected_drives(seen, len(fleet.prepared)):
        d = group[0]
        middle = len(state.drives[d].pose) // 2
        held = gtsam.noiseModel.Diagonal.Sigmas(_held_sigmas(fleet, state, d))
        graph.add(gtsam.PriorFactorPose2(pose_key(d, middle), gtsam.Pose2(*state.drives[d].pose[middle]), held))
    return graph


def _held_sigmas(fleet: Fleet, state: MapState, d: int) -> Floats:
    """1-sigma (3,) of a drive's middle pose under a rigid alignment: x, y in m, heading in rad.

    Fixes closer in time than the slow error's duration count as one.
    """
    fixes, stamp_ns = fleet.fixes[d], fleet.prepared[d].stamp_ns
    independent = max(1.0, float(stamp_ns[-1] - stamp_ns[0]) * 1e-9 / SLOW_TIME_S)
    sigma_m = max(fixes.bias_sigma_m, fixes.sigma_m) / math.sqrt(independent)
    extent_m = float(np.sqrt(np.var(state.drives[d].pose[:, :2], axis=0).sum()))
    return np.array([sigma_m, sigma_m, sigma_m / max(extent_m, 1.0)])


def _group_alignment(fleet: Fleet, state: MapState, group: tuple[int, ...]) -> RigidAlignment:
    """The motion that brings a group's antennas onto its trusted fixes."""
    antenna, fix = [], []
    for d in group:
        each, rows = fleet.prepared[d], np.nonzero(fleet.trusted[d])[0]
        arm = transform_points(each.fix_offset[rows], state.drives[d].antenna_m)
        antenna.append(transform_points(state.drives[d].pose[each.fix_keyframe[rows]], arm))
        fix.append(each.fix_m[rows])
    try:
        return rigid_alignment(np.concatenate(antenna), np.concatenate(fix), sigma_m=FIX_SIGMA_M)
    except AlignmentRefused as error:
        names = ", ".join(fleet.prepared[d].drive.vehicle for d in group)
        raise AlignmentRefused(f"{names}: {error}") from error


def _moved(state: MapState, group: tuple[int, ...], alignment: RigidAlignment, seen: Seen) -> MapState:
    """The state with the group's poses and landmarks moved by the alignment."""
    T_map_path = np.array([alignment.T_map_path.x_m, alignment.T_map_path.y_m, alignment.T_map_path.heading_rad])
    drives = list(state.drives)
    for d in group:
        pose = drives[d].pose
        heading = wrap_angles_rad(pose[:, 2] + T_map_path[2])
        drives[d] = replace(drives[d], pose=np.column_stack([transform_points(T_map_path, pose[:, :2]), heading]))
    point, track, seers = state.landmark_m.copy(), state.track_m.copy(), seen.seers()
    own = np.unique(seers[np.isin(seers[:, 0], group), 1])
    point[own] = transform_points(T_map_path, point[own])
    tracked = np.unique(seen.sightings.track[np.isin(seen.sightings.drive, group) & (seen.sightings.shared_m2 > 0.0)])
    track[tracked] = transform_points(T_map_path, track[tracked])
    return replace(state, drives=tuple(drives), landmark_m=point, track_m=track)

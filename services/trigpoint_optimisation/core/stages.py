"""The whole solve: odometry and fixes, then landmarks, then anchors; each from the converged one before."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import gtsam
import numpy as np
from numpy.typing import NDArray

from trigpoint.anchoring.association import (
    Assignment,
    AssociationLimits,
    MapKnowledge,
    by_signature,
    is_by_signature,
    nearest_assignment,
)
from trigpoint.anchoring.labels import Labels, labels_of
from trigpoint.errors import AlignmentRefused
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.drives import Drive
from trigpoint.geodesy.projection import MapFrame
from trigpoint_optimisation.core.anchoring import (
    residuals_m,
    signed_points,
    tied_labels,
    voted_assignment,
    without_outliers,
)
from trigpoint_optimisation.core.association import (
    Association,
    first_association,
    fleet_sightings,
    fleet_single_sightings,
    landmark_means,
    renewed_association,
    shared_tracks,
    tracks_in_map,
    with_measured_noise,
)
from trigpoint_optimisation.core.fleet import (
    Fleet,
    Progress,
    georeferenced_graph,
    prepared_fleet,
    recalibrated,
    solved_state,
)
from trigpoint_optimisation.core.fleet_placing import LeftOut, PlacedFleet, drivable, placed_fleet
from trigpoint_optimisation.core.graph import add_labels, add_sightings, add_single_sightings
from trigpoint_optimisation.core.loops import add_loops, loop_poses
from trigpoint_optimisation.core.marginals import Reduced, covariance_of, reduced
from trigpoint_optimisation.core.rigid import Seen, rigid_graph, rigid_state
from trigpoint_optimisation.core.sightings import Sightings
from trigpoint_optimisation.core.single_sightings import SingleSightings
from trigpoint_optimisation.core.state import MapState, image_key, landmark_key, values_of
from trigpoint_optimisation.settings import Kernel, SolveSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

ASSOCIATION_ROUNDS = 3
SINGLE_KERNELS = (Kernel("cauchy", 10.0), Kernel("cauchy", 3.0), Kernel("cauchy", 2.0))
WIDENED_ITERATIONS = 5  # with loops' sigmas widened: where it ends is only the next one's start
SINGLE_ITERATIONS = 5  # at each of them: where it ends is only the next one's start


@dataclass(frozen=True, slots=True, kw_only=True)
class Solved:
    """A solved fleet: its state, which detection is of which landmark, which label of which, the sightings, averaged
    and single, and the drives that could not be placed."""

    fleet: Fleet
    state: MapState
    association: Association
    sightings: Sightings
    labels: Labels
    assignment: Assignment
    singles: SingleSightings
    left_out: tuple[LeftOut, ...] = ()


def in_silence(stage: str, part: float) -> None:
    """Progress for nobody."""


def solve_fleet(
    drives: Sequence[Drive],
    anchors: Sequence[AnchorLabelled],
    frame: MapFrame,
    settings: SolveSettings,
    *,
    allowed: Sequence[Bools] | None = None,
    progress: Progress = in_silence,
) -> Solved:
    """The fleet solved by the settings' method; `allowed` (f,) per drive says which fixes may be used.

    Drives whose place the data leave undetermined are left out; raises AlignmentRefused when all are.
    """
    masks = allowed if allowed is not None else [np.ones(len(drive.fixes.stamp_ns), dtype=bool) for drive in drives]
    chosen, left_out = drivable(drives)
    fleet = prepared_fleet([drives[i] for i in chosen], frame, settings, allowed=[masks[i] for i in chosen])
    labels = labels_of(anchors if settings.method == "anchored" else (), frame, image_offsets=settings.image_offsets)
    placed = placed_fleet(fleet, signed_points(labels), left_out=left_out, progress=progress)
    solved = _with_landmarks(placed, no_labels()[0] if placed.by_fixes else labels, progress)
    if settings.method == "rigid":
        return replace(solved, state=rigid_state(solved.fleet, solved.state, seen_by(solved)))
    if settings.method == "anchored":
        solved = anchored(solved, labels, progress=progress)
    return solved


def no_labels() -> tuple[Labels, Assignment]:
    """No labels and nothing assigned."""
    none = np.zeros(0, dtype=np.int64)
    labels = Labels(
        name=(),
        labelled_in=(),
        label_m=np.zeros((0, 2)),
        sigma_m=np.zeros(0),
        image=none,
        kind=(),
        signature=(),
        images=(),
        image_sigma_m=np.zeros(0),
    )
    return labels, Assignment(landmark=none, reason=())


def _with_landmarks(placed: PlacedFleet, labels: Labels, progress: Progress) -> Solved:
    """Landmarks associated and solved for, in rounds: each solve makes the next association surer.

    Labels of known landmarks are tied from the start: where fixes do not hold the map, nothing else may.
    """
    fleet = placed.fleet
    state = replace(with_loops(fleet, placed.state), image_m=np.zeros((len(labels.images), 2)))
    solved = _associated(fleet, state, first_association(fleet, state), labels)
    solved = replace(solved, left_out=placed.left_out)
    if len(solved.singles.row):
        solved = _calibrated(solved, progress)
    for turn in range(ASSOCIATION_ROUNDS):
        state = solved_state(full_graph(solved), solved.state)
        fleet = with_measured_noise(recalibrated(solved.fleet, state), state, solved.association)
        progress("landmarks", (turn + 1) / ASSOCIATION_ROUNDS)
        renewed = renewed_association(fleet, state, solved.association)
        if np.array_equal(renewed.landmark_of_track, solved.association.landmark_of_track):
            break
        solved = replace(_associated(fleet, state, renewed, labels), left_out=placed.left_out)
        fleet, state = solved.fleet, solved.state
    solved = _resighted(replace(solved, fleet=fleet, state=state))
    return replace(solved, state=solved_state(full_graph(solved), solved.state))


def with_loops(fleet: Fleet, state: MapState) -> MapState:
    """The state with closed loops let in: their sigmas are wide at first, then ever narrower."""
    loops, scale = fleet.settings.loops, fleet.frame.point_scale
    if not loops.used or not loop_poses(fleet.prepared, point_scale=scale):
        return state
    for wide_m in loops.widened_m:
        graph = georeferenced_graph(fleet, robust=True)
        add_loops(graph, fleet.prepared, loops, point_scale=scale, wide_m=wide_m)
        state = solved_state(graph, state, max_iterations=WIDENED_ITERATIONS)
    return state


def _associated(fleet: Fleet, state: MapState, association: Association, labels: Labels) -> Solved:
    """The fleet with landmarks where the association's tracks have their means."""
    tracks, sightings = tracks_in_map(fleet, state, association), fleet_sightings(fleet, association)
    solved = Solved(
        fleet=fleet,
        state=replace(
            state,
            landmark_m=landmark_means(tracks, association.landmark_of_track),
            track_m=shared_tracks(sightings, tracks.point_m),
        ),
        association=association,
        sightings=sightings,
        singles=fleet_single_sightings(fleet, association),
        labels=labels,
        assignment=no_labels()[1],
    )
    return replace(solved, assignment=by_signature(labels, landmark_signatures(solved)))


def _resighted(solved: Solved) -> Solved:
    """The solve with its sightings made anew, as a new calibration of odometry moves them."""
    return replace(
        solved,
        sightings=fleet_sightings(solved.fleet, solved.association),
        singles=fleet_single_sightings(solved.fleet, solved.association),
    )


def _calibrated(solved: Solved, progress: Progress) -> Solved:
    """The solve from wide kernels on single sightings to narrow ones: a sensor far from its nominal calibration
    would have its sightings taken for outliers."""
    for turn, kernel in enumerate(SINGLE_KERNELS):
        graph = full_graph(solved, single_kernel=kernel)
        state = solved_state(graph, solved.state, max_iterations=SINGLE_ITERATIONS)
        solved = _resighted(replace(solved, fleet=recalibrated(solved.fleet, state), state=state))
        progress("calibration", (turn + 1) / len(SINGLE_KERNELS))
    return solved


def with_fix_bias(state: MapState) -> bool:
    """Whether slow errors of fixes are among the states: a rigidly aligned map has let go of its fixes."""
    return any(len(drive.fix_bias_m) for drive in state.drives)


def seen_by(solved: Solved) -> Seen:
    """Everything the fleet saw, under the association."""
    landmark = solved.association.landmark_of_track[solved.sightings.track]
    return Seen(sightings=solved.sightings, landmark=landmark, singles=solved.singles)


def full_graph(
    solved: Solved, *, with_labels: bool = True, single_kernel: Kernel | None = None
) -> gtsam.NonlinearFactorGraph:
    """The graph of a solve: odometry, fixes, landmarks, and labels if wanted; kernels on fixes and sightings."""
    settings, seen = solved.fleet.settings, seen_by(solved)
    if settings.method == "rigid" and not with_fix_bias(solved.state):
        return rigid_graph(solved.fleet, solved.state, seen)
    graph = georeferenced_graph(solved.fleet, robust=True)
    add_sightings(graph, seen.sightings, seen.landmark, kernel=settings.fixes.landmark_kernel)
    add_single_sightings(graph, seen.singles, kernel=single_kernel or settings.detections.single_kernel)
    if with_labels:
        add_labels(graph, tied_labels(solved.labels, solved.assignment))
    return graph


def anchored(solved: Solved, labels: Labels, *, progress: Progress) -> Solved:
    """The fleet with labels tied: first those a joint shift of the map explains, then, solve by solve, the rest.

    Raises AlignmentRefused when there are labels and none finds its landmark.
    """
    solved = replace(solved, labels=labels, state=replace(solved.state, image_m=np.zeros((len(labels.images), 2))))
    assignment = first_assignment(solved)
    if len(labels.name) and not (assignment.landmark >= 0).any():
        raise AlignmentRefused(f"none of {len(labels.name)} anchors finds its landmark: {assignment.reason[0]}")
    for turn in range(solved.fleet.settings.anchors.rounds):
        solved = replace(solved, assignment=assignment)
        solved = replace(solved, state=solved_state(full_graph(solved), solved.state))
        progress("anchors", (turn + 1) / solved.fleet.settings.anchors.rounds)
        renewed = renewed_assignment(solved)
        if np.array_equal(renewed.landmark, assignment.landmark):
            return replace(solved, assignment=renewed)
        assignment = renewed
    return solved


def landmark_signatures(solved: Solved) -> tuple[str, ...]:
    """The known identity of each landmark, empty where detections carry none."""
    found = [""] * solved.association.landmark_count
    for each, track in zip(solved.fleet.prepared, solved.association.track, strict=True):
        for row in np.nonzero(track >= 0)[0]:
            signature = each.drive.detections.signature[row]
            if signature:
                found[int(solved.association.landmark_of_track[track[row]])] = signature
    return tuple(found)


def first_assignment(solved: Solved) -> Assignment:
    """Labels tied before any solve with labels: by signature if they carry one and it is to be used, else by vote."""
    settings, labels = solved.fleet.settings, solved.labels
    named = by_signature(labels, landmark_signatures(solved))
    if (named.landmark >= 0).any():
        return named
    return voted_assignment(labels, solved.state.landmark_m, settings=settings.anchors, detections=settings.detections)


def renewed_assignment(solved: Solved) -> Assignment:
    """Labels tied anew after a solve; those whose residual is beyond belief are let go."""
    settings, labels, state = solved.fleet.settings.anchors, solved.labels, solved.state
    if is_by_signature(solved.assignment.reason):
        assignment = by_signature(labels, landmark_signatures(solved))
    else:
        limits = AssociationLimits(gate_sigmas=settings.gate_sigmas, second_ratio=settings.second_ratio)
        assignment = nearest_assignment(labels, _known(solved), limits=limits)
    residual = residuals_m(labels, assignment, state.landmark_m, state.image_m)
    limit_sigmas = settings.outlier_sigmas
    return without_outliers(assignment, solved.assignment, residual, _residual_sigma(solved), limit_sigmas=limit_sigmas)


def _known(solved: Solved) -> MapKnowledge:
    """What the solve knows of landmarks and images, untied labels' images included."""
    count = solved.association.landmark_count
    variance = np.diag(covariance_of(reduced_landmarks(solved))).reshape(-1, 2).max(axis=1)
    return MapKnowledge(
        landmark_m=solved.state.landmark_m,
        landmark_variance_m2=variance[:count],
        image_m=solved.state.image_m,
        image_variance_m2=variance[count:],
    )


def _residual_sigma(solved: Solved) -> Floats:
    """1-sigma per axis (a,) that a tied label's residual is held against: its own and a landmark's local one."""
    return np.hypot(solved.labels.sigma_m, solved.fleet.settings.anchors.landmark_sigma_m)


def reduced_landmarks(solved: Solved, *, kept: Ints | None = None, with_labels: bool = True) -> Reduced:
    """Everything marginalised onto the kept landmarks (all by default), then all image offsets if labels are in."""
    numbers = np.arange(solved.association.landmark_count) if kept is None else kept
    keys = [landmark_key(int(j)) for j in numbers]
    state = solved.state
    if with_labels:
        keys += [image_key(i) for i in range(len(state.image_m))]
    else:
        state = replace(state, image_m=np.zeros((0, 2)))
    return reduced(full_graph(solved, with_labels=with_labels), values_of(state), keys)

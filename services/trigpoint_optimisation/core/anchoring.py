"""Which landmark the first labels are of, and which labels to believe."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.anchoring.association import UNASSIGNED, Assignment
from trigpoint.anchoring.labels import Labels, image_shifts_m
from trigpoint_optimisation.core.graph import TiedLabels
from trigpoint_optimisation.core.merging import joint_shift_pairs
from trigpoint_optimisation.settings import AnchorSettings, DetectionSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BEYOND_BELIEF = "residual"  # how the reason begins for a label that was tied, solved for, and let go


def signed_points(labels: Labels) -> dict[str, Floats]:
    """Where labels (2,) of known identity are, by signature."""
    return {name: point_m for name, point_m in zip(labels.signature, labels.label_m, strict=True) if name}


def _neighbourhoods(label_m: Floats, reach_m: float) -> tuple[Ints, ...]:
    """For each label, the labels (indices) within reach of it."""
    distance = np.hypot(*(label_m[:, None, :] - label_m[None, :, :]).transpose(2, 0, 1))
    return tuple(np.nonzero(row <= reach_m)[0] for row in distance)


def voted_assignment(
    labels: Labels, landmark_m: Floats, *, settings: AnchorSettings, detections: DetectionSettings
) -> Assignment:
    """Labels tied where a neighbourhood's labels agree on one joint shift and turn of the map: good for a map that
    is off by metres, and silent where poles look alike."""
    votes: dict[tuple[int, int], int] = {}
    reach = replace(
        detections, vote_reach_m=settings.vote_reach_m, vote_cell_m=settings.vote_cell_m, min_votes=settings.min_votes
    )
    for members in _neighbourhoods(labels.label_m, settings.neighbourhood_m):
        if len(members) < settings.min_votes:
            continue
        for a, b in joint_shift_pairs(labels.label_m[members], landmark_m, settings=reach):
            pair = int(members[a]), int(b)
            votes[pair] = votes.get(pair, 0) + 1
    return _most_voted(votes, len(labels.name))


def _most_voted(votes: dict[tuple[int, int], int], count: int) -> Assignment:
    """Each label and each landmark in one pair at most, most votes first."""
    landmark = np.full(count, UNASSIGNED, dtype=np.int64)
    taken: set[int] = set()
    for (label, found), _ in sorted(votes.items(), key=lambda item: (-item[1], item[0])):
        if landmark[label] == UNASSIGNED and found not in taken:
            landmark[label] = found
            taken.add(found)
    reason = tuple("joint shift" if found >= 0 else "no joint shift stands out" for found in landmark)
    return Assignment(landmark=landmark, reason=reason)


def tied_labels(labels: Labels, assignment: Assignment) -> TiedLabels:
    """The assigned labels ready for the graph."""
    rows = np.nonzero(assignment.landmark >= 0)[0]
    return TiedLabels(
        landmark=assignment.landmark[rows],
        label_m=labels.label_m[rows],
        sigma_m=labels.sigma_m[rows],
        image=labels.image[rows],
        image_sigma_m=labels.image_sigma_m,
    )


def residuals_m(labels: Labels, assignment: Assignment, landmark_m: Floats, image_m: Floats) -> Floats:
    """Label minus landmark minus its image's offset (a, 2); NaN where unassigned."""
    residual = np.full((len(labels.name), 2), np.nan)
    rows = np.nonzero(assignment.landmark >= 0)[0]
    shift_m = image_shifts_m(labels, image_m)
    residual[rows] = labels.label_m[rows] - landmark_m[assignment.landmark[rows]] - shift_m[rows]
    return residual


def without_outliers(
    assignment: Assignment, before: Assignment, residual_m: Floats, sigma_m: Floats, *, limit_sigmas: float
) -> Assignment:
    """The assignment without labels that were solved for and whose residual (a, 2) exceeds the limit, in sigmas of
    the label itself, now or `before`.

    A label tied only now is not judged yet: the offset of an image none of whose labels was tied is unknown.
    """
    size = np.hypot(*residual_m.T) / sigma_m
    solved_for = (assignment.landmark >= 0) & (assignment.landmark == before.landmark)
    out = solved_for & (size > limit_sigmas)
    stays_out = np.array([why.startswith(BEYOND_BELIEF) for why in before.reason], dtype=bool)
    reason = tuple(
        before.reason[i]
        if stays_out[i]
        else f"{BEYOND_BELIEF} {size[i]:.1f} sigma, limit {limit_sigmas:.1f}"
        if out[i]
        else why
        for i, why in enumerate(assignment.reason)
    )
    return Assignment(landmark=np.where(out | stays_out, UNASSIGNED, assignment.landmark), reason=reason)

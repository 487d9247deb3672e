"""Which landmark each label is of, and which labels to believe."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.corrected import AnchorLabelled
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84
from trigpoint_optimisation.core.graph import TiedLabels
from trigpoint_optimisation.core.merging import joint_shift_pairs
from trigpoint_optimisation.settings import AnchorSettings, DetectionSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

UNASSIGNED = -1
NO_IMAGE = -1
BEYOND_BELIEF = "residual"  # how the reason begins for a label that was tied, solved for, and let go


@dataclass(frozen=True, slots=True, kw_only=True)
class Labels:
    """All labels (a,): name, image they were `labelled_in` (empty: a survey), position label_m (a, 2) in the map,
    sigma_m (a,), image (a,) whose offset they share or NO_IMAGE; kind and signature as labelled; `images` names,
    image_sigma_m (k,)."""

    name: tuple[str, ...]
    labelled_in: tuple[str, ...]
    label_m: Floats
    sigma_m: Floats
    image: Ints
    kind: tuple[str, ...]
    signature: tuple[str, ...]
    images: tuple[str, ...]
    image_sigma_m: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    """The landmark (a,) each label is tied to, UNASSIGNED where none, and why."""

    landmark: Ints
    reason: tuple[str, ...]


def labels_of(anchors: Sequence[AnchorLabelled], frame: MapFrame, *, image_offsets: bool) -> Labels:
    """The labels in the map frame; without `image_offsets` no label has an image."""
    lat = np.array([anchor.lat_deg for anchor in anchors], dtype=np.float64)
    lon = np.array([anchor.lon_deg for anchor in anchors], dtype=np.float64)
    offset = [anchor.image if image_offsets and anchor.image_sigma_m > 0.0 else "" for anchor in anchors]
    images = tuple(sorted(set(offset) - {""}))
    sigma = {anchor.image: anchor.image_sigma_m for anchor in anchors}
    return Labels(
        name=tuple(anchor.anchor for anchor in anchors),
        labelled_in=tuple(anchor.image for anchor in anchors),
        label_m=map_points_from_wgs84(lat, lon, frame) if len(anchors) else np.zeros((0, 2)),
        sigma_m=np.array([anchor.sigma_m for anchor in anchors], dtype=np.float64),
        image=np.array([images.index(name) if name else NO_IMAGE for name in offset], dtype=np.int64),
        kind=tuple(anchor.kind for anchor in anchors),
        signature=tuple(anchor.signature for anchor in anchors),
        images=images,
        image_sigma_m=np.array([sigma[name] for name in images], dtype=np.float64),
    )


def signed_points(labels: Labels) -> dict[str, Floats]:
    """Where labels (2,) of known identity are, by signature."""
    return {name: point_m for name, point_m in zip(labels.signature, labels.label_m, strict=True) if name}


def by_signature(labels: Labels, signature: Sequence[str]) -> Assignment:
    """Labels tied to the landmark (numbered by `signature`) of the same known identity."""
    number = {name: index for index, name in enumerate(signature) if name}
    landmark = [number.get(name, UNASSIGNED) if name else UNASSIGNED for name in labels.signature]
    reason = tuple("signature" if found >= 0 else "no landmark of that signature" for found in landmark)
    return Assignment(landmark=np.array(landmark, dtype=np.int64), reason=reason)


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


def nearest_assignment(
    labels: Labels, landmark_m: Floats, *, shift_m: Floats, sigma_m: Floats, settings: AnchorSettings
) -> Assignment:
    """Labels tied to their mutually nearest landmark within a gate, unless a second one is nearly as near.

    shift_m (a, 2): the label's expected offset from its landmark (its image's); sigma_m (a,): 1-sigma per axis of
    what remains.
    """
    landmark = np.full(len(labels.name), UNASSIGNED, dtype=np.int64)
    if not len(landmark_m) or not len(landmark):
        return Assignment(landmark=landmark, reason=tuple("no landmark" for _ in labels.name))
    expected = labels.label_m - shift_m
    distance = np.hypot(*(expected[:, None, :] - landmark_m[None, :, :]).transpose(2, 0, 1))
    order = np.argsort(distance, axis=1)[:, :2]
    nearest_label = distance.argmin(axis=0)
    reason = []
    for label, gate_m in enumerate(settings.gate_sigmas * sigma_m):
        nearest = int(order[label, 0])
        first = distance[label, nearest]
        second = distance[label, order[label, 1]] if order.shape[1] > 1 else np.inf
        if first > gate_m:
            reason.append(f"nearest landmark {first:.2f} m away, gate {gate_m:.2f} m")
        elif nearest_label[nearest] != label:
            reason.append("another label is nearer to the landmark")
        elif second < settings.second_ratio * first and second < gate_m:
            reason.append(f"two landmarks {first:.2f} m and {second:.2f} m away")
        else:
            landmark[label] = nearest
            reason.append("mutually nearest")
    return Assignment(landmark=landmark, reason=tuple(reason))


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


def image_shifts_m(labels: Labels, image_m: Floats) -> Floats:
    """The offset (a, 2) of each label's image; zero where it has none."""
    shift_m: Floats = np.vstack([image_m, np.zeros((1, 2))])[labels.image]
    return shift_m


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

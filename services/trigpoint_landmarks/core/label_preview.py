"""What the next solve would do with one more label, by its own rule, as the map stands."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from trigpoint.anchoring.association import (
    NONE_SIGNED,
    AssociationLimits,
    MapKnowledge,
    Neighbours,
    is_by_signature,
    nearest_assignment,
    neighbours_of,
)
from trigpoint.anchoring.labels import NO_IMAGE, Labels

Point = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchoringRule:
    """How a version ties labels: whether it does, whether images have offsets, the limits, and of how many labels
    within which distance the first ones are tied."""

    is_anchored: bool
    image_offsets: bool
    limits: AssociationLimits
    min_votes: int
    neighbourhood_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownLandmark:
    """A landmark of the map: its place on the grid and in degrees, of both axes' variances the larger."""

    landmark: str
    kind: str
    signature: str
    grid_m: Point
    lon_lat_deg: Point
    variance_m2: float
    sigma_major_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownAnchor:
    """A label of the map: where it lies on the grid, and what it is tied to ("": nothing)."""

    anchor: str
    image: str
    grid_m: Point
    sigma_m: float
    landmark: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownImage:
    """An image's offset on the grid, of both axes' variances the larger."""

    offset_m: Point
    variance_m2: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ProspectiveLabel:
    """A label nobody has set yet; an image of "", or of no sigma, is a survey."""

    anchor: str
    image: str
    grid_m: Point
    sigma_m: float
    image_sigma_m: float
    signature: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MapAround:
    """What is known around a label: all landmarks within reach, and every label and image of the map."""

    landmarks: Sequence[KnownLandmark]
    anchors: Sequence[KnownAnchor]
    images: Mapping[str, KnownImage]


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelPreview:
    """The landmark a label would be tied to (`is_tied`), or the nearest one and why not.

    `gate_m` is the limit of `corrected_m`, the distance once the image's offset is taken off, and `chi_square` and
    `chi_square_limit` are the same in squared sigmas; None where nothing stands around or identities decide.
    """

    is_tied: bool
    reason: str
    nearest: KnownLandmark | None = None
    runner_up: KnownLandmark | None = None
    distance_m: float | None = None
    corrected_m: float | None = None
    runner_up_m: float | None = None
    gate_m: float | None = None
    chi_square: float | None = None
    chi_square_limit: float | None = None


def with_waiting(anchors: Sequence[KnownAnchor], waiting: Sequence[KnownAnchor]) -> tuple[KnownAnchor, ...]:
    """The map's labels and those that wait for its next version; of one that was moved since, where it lies now."""
    by_name = {(one.anchor, one.image): one for one in anchors}
    for one in waiting:
        known = by_name.get((one.anchor, one.image))
        tied = one if known is None else replace(known, grid_m=one.grid_m, sigma_m=one.sigma_m)
        by_name[one.anchor, one.image] = tied
    return tuple(by_name.values())


def previewed(label: ProspectiveLabel, around: MapAround, rule: AnchoringRule) -> LabelPreview:
    """What would become of a label."""
    anchors = [one for one in around.anchors if (one.anchor, one.image) != (label.anchor, label.image)]
    if not rule.is_anchored:
        return _beside(label, around, rule, "the map is solved without anchors")
    if is_by_signature([one.reason for one in anchors]):
        return _by_signature(label, around)
    if not any(one.landmark for one in anchors):
        return _beside(label, around, rule, _too_few(label, anchors, rule))
    if not around.landmarks:
        return LabelPreview(is_tied=False, reason="no landmark")
    labels, known = _labels([*anchors, label], around, rule), _knowledge(label, around, anchors, rule)
    assignment = nearest_assignment(labels, known, limits=rule.limits)
    near = _near(label, around, neighbours_of(labels, known, limits=rule.limits), rule)
    is_tied = bool(assignment.landmark[-1] >= 0)
    return replace(near, is_tied=is_tied, reason=assignment.reason[-1])


def expected_place(label: ProspectiveLabel, images: Mapping[str, KnownImage], rule: AnchoringRule) -> Point:
    """Where a label's landmark is looked for on the grid: the image's offset taken off."""
    known = images.get(label.image) if _shares_offset(label, rule) else None
    off = known.offset_m if known else (0.0, 0.0)
    return label.grid_m[0] - off[0], label.grid_m[1] - off[1]


def _shares_offset(label: KnownAnchor | ProspectiveLabel, rule: AnchoringRule) -> bool:
    """Whether a label is off by its image; one of an image without sigma is as good as a survey."""
    surveyed = isinstance(label, ProspectiveLabel) and label.image_sigma_m == 0.0
    return rule.image_offsets and label.image != "" and not surveyed


def _too_few(label: ProspectiveLabel, anchors: Sequence[KnownAnchor], rule: AnchoringRule) -> str:
    near = sum(math.dist(one.grid_m, label.grid_m) <= rule.neighbourhood_m for one in anchors)
    return (
        f"no anchor is tied yet: the first ones are tied together, where {rule.min_votes} labels within "
        f"{rule.neighbourhood_m:g} m agree on one shift of the map; with this one there are {near + 1}"
    )


def _by_signature(label: ProspectiveLabel, around: MapAround) -> LabelPreview:
    """By known identity, as all labels of this map."""
    named = [one for one in around.landmarks if label.signature and one.signature == label.signature]
    if not named:
        return LabelPreview(is_tied=False, reason=NONE_SIGNED)
    distance_m = math.dist(label.grid_m, named[-1].grid_m)
    return LabelPreview(is_tied=True, reason="signature", nearest=named[-1], distance_m=distance_m)


def _beside(label: ProspectiveLabel, around: MapAround, rule: AnchoringRule, reason: str) -> LabelPreview:
    """No landmark for a reason, and which one is the nearest all the same."""
    if not around.landmarks:
        return LabelPreview(is_tied=False, reason=reason)
    labels, known = _labels([label], around, rule), _knowledge(label, around, (), rule)
    near = _near(label, around, neighbours_of(labels, known, limits=rule.limits), rule)
    return replace(near, reason=reason)


def _labels(given: Sequence[KnownAnchor | ProspectiveLabel], around: MapAround, rule: AnchoringRule) -> Labels:
    """The labels as the solve takes them, on the grid."""
    images = _images(given, around, rule)
    shared = [one.image if one.image in images and _shares_offset(one, rule) else "" for one in given]
    return Labels(
        name=tuple(one.anchor for one in given),
        labelled_in=tuple(one.image for one in given),
        label_m=np.array([one.grid_m for one in given], dtype=np.float64),
        sigma_m=np.array([one.sigma_m for one in given], dtype=np.float64),
        image=np.array([images.index(name) if name else NO_IMAGE for name in shared], dtype=np.int64),
        kind=("",) * len(given),
        signature=("",) * len(given),
        images=images,
        image_sigma_m=np.zeros(len(images)),
    )


def _images(given: Sequence[KnownAnchor | ProspectiveLabel], around: MapAround, rule: AnchoringRule) -> tuple[str, ...]:
    """The images that have an offset: those of the map, and the new label's own."""
    if not rule.image_offsets:
        return ()
    own = {one.image for one in given if isinstance(one, ProspectiveLabel) and _shares_offset(one, rule)}
    return tuple(sorted(own | set(around.images)))


def _knowledge(
    label: ProspectiveLabel, around: MapAround, anchors: Sequence[KnownAnchor], rule: AnchoringRule
) -> MapKnowledge:
    new = KnownImage(offset_m=(0.0, 0.0), variance_m2=label.image_sigma_m**2)  # nothing but what its maker says
    images = [around.images.get(name, new) for name in _images([*anchors, label], around, rule)]
    return MapKnowledge(
        landmark_m=np.array([one.grid_m for one in around.landmarks], dtype=np.float64),
        landmark_variance_m2=np.array([one.variance_m2 for one in around.landmarks], dtype=np.float64),
        image_m=np.array([one.offset_m for one in images], dtype=np.float64).reshape(-1, 2),
        image_variance_m2=np.array([one.variance_m2 for one in images], dtype=np.float64),
    )


def _near(label: ProspectiveLabel, around: MapAround, found: Neighbours, rule: AnchoringRule) -> LabelPreview:
    """What stands around the last label, with no verdict yet."""
    nearest, second = around.landmarks[int(found.nearest[-1])], int(found.second[-1])
    corrected_m, gate_m = float(found.distance_m[-1]), float(found.gate_m[-1])
    sigmas = rule.limits.gate_sigmas
    return LabelPreview(
        is_tied=False,
        reason="",
        nearest=nearest,
        runner_up=around.landmarks[second] if second >= 0 else None,
        distance_m=math.dist(label.grid_m, nearest.grid_m),
        corrected_m=corrected_m,
        runner_up_m=float(found.second_m[-1]) if second >= 0 else None,
        gate_m=gate_m,
        chi_square=(corrected_m / gate_m * sigmas) ** 2,
        chi_square_limit=sigmas**2,
    )

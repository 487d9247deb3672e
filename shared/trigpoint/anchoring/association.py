"""Which landmark a label is of: the solve's own rule, and what it looks at."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.anchoring.labels import Labels, image_shifts_m

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

UNASSIGNED = -1
NONE_SIGNED = "no landmark of that signature"


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    """The landmark (a,) each label is tied to, UNASSIGNED where none, and why."""

    landmark: Ints
    reason: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class AssociationLimits:
    """A label's landmark lies within `gate_sigmas` of what is expected, and the next one `second_ratio` times as far
    off, or beyond the gate."""

    gate_sigmas: float
    second_ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MapKnowledge:
    """What a solve knows: landmarks landmark_m (l, 2) with variance (l,), offsets image_m (k, 2) of the labels' images
    with variance (k,); map frame, m and m^2, of both axes' variances the larger."""

    landmark_m: Floats
    landmark_variance_m2: Floats
    image_m: Floats
    image_variance_m2: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbours:
    """What stands around each label (a,), its image's offset taken off: the nearest landmark and its distance in m, the
    second one (UNASSIGNED and infinity: there is none), the gate in m, and whether no other label is nearer to the
    nearest."""

    nearest: Ints
    distance_m: Floats
    second: Ints
    second_m: Floats
    gate_m: Floats
    is_mutual: Bools


def by_signature(labels: Labels, signature: Sequence[str]) -> Assignment:
    """Labels tied to the landmark (numbered by `signature`) of the same known identity."""
    number = {name: index for index, name in enumerate(signature) if name}
    landmark = [number.get(name, UNASSIGNED) if name else UNASSIGNED for name in labels.signature]
    reason = tuple("signature" if found >= 0 else NONE_SIGNED for found in landmark)
    return Assignment(landmark=np.array(landmark, dtype=np.int64), reason=reason)


def is_by_signature(reasons: Sequence[str]) -> bool:
    """Whether labels of these reasons were tied by known identities: then all of them are."""
    return "signature" in reasons


def neighbours_of(labels: Labels, known: MapKnowledge, *, limits: AssociationLimits) -> Neighbours:
    """What stands around each label of at least one, on a map of at least one landmark."""
    expected = labels.label_m - image_shifts_m(labels, known.image_m)
    distance = np.hypot(*(expected[:, None, :] - known.landmark_m[None, :, :]).transpose(2, 0, 1))
    order = np.argsort(distance, axis=1)[:, :2]
    rows = np.arange(len(distance))
    nearest, has_second = order[:, 0], order.shape[1] > 1
    image_m2 = np.append(known.image_variance_m2, 0.0)[labels.image]
    expected_m2 = known.landmark_variance_m2[nearest] + image_m2 + labels.sigma_m**2
    return Neighbours(
        nearest=nearest,
        distance_m=distance[rows, nearest],
        second=order[:, 1] if has_second else np.full(len(rows), UNASSIGNED),
        second_m=distance[rows, order[:, 1]] if has_second else np.full(len(rows), np.inf),
        gate_m=limits.gate_sigmas * np.sqrt(expected_m2),
        is_mutual=distance.argmin(axis=0)[nearest] == rows,
    )


def nearest_assignment(labels: Labels, known: MapKnowledge, *, limits: AssociationLimits) -> Assignment:
    """Labels tied to their mutually nearest landmark within a gate, unless a second one is nearly as near.

    The gate is so many times 1-sigma per axis of what remains once the image's offset is taken off: the nearest
    landmark's, the image's and the label's own.
    """
    landmark = np.full(len(labels.name), UNASSIGNED, dtype=np.int64)
    if not len(known.landmark_m) or not len(landmark):
        return Assignment(landmark=landmark, reason=tuple("no landmark" for _ in labels.name))
    around = neighbours_of(labels, known, limits=limits)
    refused = tuple(_refusal(around, label, limits) for label in range(len(landmark)))
    tied = np.array([not why for why in refused], dtype=bool)
    landmark[tied] = around.nearest[tied]
    return Assignment(landmark=landmark, reason=tuple(why or "mutually nearest" for why in refused))


def _refusal(around: Neighbours, label: int, limits: AssociationLimits) -> str:
    """Why a label is not tied to its nearest landmark, empty if it is."""
    first, second, gate = around.distance_m[label], around.second_m[label], around.gate_m[label]
    if first > gate:
        return f"nearest landmark {first:.2f} m away, gate {gate:.2f} m"
    if not around.is_mutual[label]:
        return "another label is nearer to the landmark"
    if second < limits.second_ratio * first and second < gate:
        return f"two landmarks {first:.2f} m and {second:.2f} m away"
    return ""

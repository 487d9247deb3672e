"""Labels as the solve takes them: where they lie in the map, how sure they are, whose image's offset they share."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.corrected import AnchorLabelled
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NO_IMAGE = -1


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


def image_shifts_m(labels: Labels, image_m: Floats) -> Floats:
    """The offset (a, 2) of each label's image; zero where it has none."""
    shift_m: Floats = np.vstack([image_m, np.zeros((1, 2))])[labels.image]
    return shift_m

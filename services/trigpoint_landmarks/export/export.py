"""An export: what is written, in what CRS, from where; and what of it was seen on the way."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

from trigpoint.landmarks.feature_crs import FeatureCrs
from trigpoint.landmarks.geopackage_writing import KINDS_MOST
from trigpoint.landmarks.layers import Layer
from trigpoint_landmarks.export.placed import PlacedFeature
from trigpoint_landmarks.export.provenance import Provenance
from trigpoint_landmarks.export.reading import Batch


class Batches(Protocol):
    """Gives the features of a layer."""

    def __call__(self, layer: Layer) -> Iterator[Batch]:
        """The features of a layer, batch by batch."""


@dataclass(slots=True)
class Export:
    """Layers of a map version in a CRS; `counts` and `kinds` say what went by, layer by layer."""

    provenance: Provenance
    crs: FeatureCrs
    layers: tuple[Layer, ...]
    batches: Batches
    counts: dict[str, int] = field(default_factory=dict)
    kinds: dict[str, list[str]] = field(default_factory=dict)

    def features(self, layer: Layer) -> Iterator[Batch]:
        """The features of a layer, counted as they go by."""
        self.counts[layer.name] = 0
        kinds: set[str] = set()
        for batch in self.batches(layer):
            self.counts[layer.name] += len(batch)
            if layer.property_named("kind") is not None:
                kinds.update(str(one.properties["kind"]) for one in batch)
            yield batch
        self.kinds[layer.name] = sorted(kinds)[:KINDS_MOST]

    @property
    def layer(self) -> Layer:
        """The only layer, of a format that holds one."""
        (layer,) = self.layers
        return layer


def told_apart_by(feature: PlacedFeature, layer: Layer) -> str:
    """What a feature's colour stands for: its kind, or itself where it has none, as a drive's path."""
    return feature.feature_id if layer.property_named("kind") is None else str(feature.properties["kind"])

"""Which ground an aerial image shows, as far as its labels tell."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from shapely.geometry import MultiPoint, Point
from shapely.geometry.base import BaseGeometry

from trigpoint_landmarks.core.label_preview import KnownAnchor
from trigpoint_landmarks.core.label_preview import Point as GridPoint

AROUND_M = 10.0  # around the hull of an image's labels


@dataclass(frozen=True, slots=True)
class Footprint:
    """An image's ground on the grid, and how many labels it is known by."""

    ground: BaseGeometry
    label_count: int

    def holds(self, grid_m: GridPoint) -> bool:
        """Whether a place is in the image."""
        return bool(self.ground.covers(Point(grid_m)))

    def outline_m(self) -> list[GridPoint]:
        """Its corners on the grid, counter-clockwise, the first one again at the end."""
        return [(float(x), float(y)) for x, y in self.ground.exterior.coords][::-1]


def label_footprints(anchors: Iterable[KnownAnchor]) -> Mapping[str, Footprint]:
    """The hull of each image's labels and what is around it, in order of image; none of surveys."""
    by_image: dict[str, list[GridPoint]] = {}
    for one in anchors:
        if one.image:
            by_image.setdefault(one.image, []).append(one.grid_m)
    return {name: _footprint(by_image[name]) for name in sorted(by_image)}


def _footprint(labels_m: list[GridPoint]) -> Footprint:
    return Footprint(MultiPoint(labels_m).convex_hull.buffer(AROUND_M, quad_segs=2), len(labels_m))

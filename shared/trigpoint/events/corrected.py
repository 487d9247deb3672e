"""What people added or took back: anchors labelled in aerial images. Writer: the anchor import of ingest."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchorLabelled:
    """A landmark's position read from a georeferenced aerial image or a survey.

    `sigma_m` is 1-sigma per axis of the label inside its image; `image_sigma_m` the image's own absolute
    accuracy per axis (0 for a survey: no offset state). `signature` the landmark's known identity, or empty.
    `source_crs` and `operation` say how the position was brought to WGS84.
    """

    anchor: str
    lat_deg: float
    lon_deg: float
    sigma_m: float
    image: str
    image_sigma_m: float
    kind: str
    signature: str
    source_crs: str
    operation: str


Corrected = AnchorLabelled


def anchors_in_force(labels: Iterable[AnchorLabelled]) -> tuple[AnchorLabelled, ...]:
    """The labels that hold, from all in order of appending: of one name in one image the last, first named first."""
    return tuple({(label.anchor, label.image): label for label in labels}.values())

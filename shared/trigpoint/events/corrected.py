"""What people added or took back: anchors labelled in aerial images, drives left out of the map. Writer: ingest."""

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


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchorRetracted:
    """The label of this name in this image does not hold any more; labelled again later, it holds again.

    `author` says who took it back, `reason` why.
    """

    anchor: str
    image: str
    author: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveExcluded:
    """From now on the map is solved as if this boot of the vehicle had never driven; `author` says so, and why."""

    vehicle: str
    boot_id: str
    author: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveIncluded:
    """An excluded drive takes part in the map again; `author` says so, and why."""

    vehicle: str
    boot_id: str
    author: str
    reason: str


Corrected = AnchorLabelled | AnchorRetracted | DriveExcluded | DriveIncluded


def anchors_in_force(corrections: Iterable[Corrected]) -> tuple[AnchorLabelled, ...]:
    """The labels that hold, from all corrections in order of appending: of one name in one image the last unless it
    was retracted after that; first named first."""
    held: dict[tuple[str, str], AnchorLabelled] = {}
    for correction in corrections:
        if isinstance(correction, AnchorLabelled):
            held[correction.anchor, correction.image] = correction
        elif isinstance(correction, AnchorRetracted):
            held.pop((correction.anchor, correction.image), None)
    return tuple(held.values())


def excluded_drives(corrections: Iterable[Corrected]) -> frozenset[tuple[str, str]]:
    """The drives (vehicle, boot id) left out of the map, from all corrections in order of appending."""
    out: set[tuple[str, str]] = set()
    for correction in corrections:
        if isinstance(correction, DriveExcluded):
            out.add((correction.vehicle, correction.boot_id))
        elif isinstance(correction, DriveIncluded):
            out.discard((correction.vehicle, correction.boot_id))
    return frozenset(out)

"""Anchors as a file states them become labels in WGS84, or are refused one by one with the reason."""

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from trigpoint.errors import EventRejected, FrameRefused
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.geodesy.positions import MapPosition, Wgs84Position
from trigpoint.geodesy.projection import (
    WGS84,
    MapFrame,
    geodesic_distances_m,
    transform_coordinates,
    transformation_between,
    wgs84_from_map,
)
from trigpoint_ingest.core.limits import LATITUDE_LIMIT_DEG, LONGITUDE_LIMIT_DEG, NOT_FINITE, OUT_OF_RANGE, TEXT_LIMIT

LABEL_SIGMA_M = 0.10  # 1-sigma per axis of a careful label in imagery of 0.1 to 0.2 m a pixel
IMAGE_SIGMA_M = 0.35  # 1-sigma per axis of orthoimagery as providers state it
SIGMA_SMALLEST_M, SIGMA_LARGEST_M = 1e-4, 100.0
FAR_LIMIT_M = 100_000.0  # from the map's origin: one city with its surroundings; a wrong zone or hemisphere is farther
BOOT_ID_DIGITS = 16

NO_NAME = "no name"
SAME_NAME = "same anchor elsewhere"
TOO_FAR = "too far"
ANCHOR_SOURCE = "anchors"


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchorRow:
    """An anchor as a file states it: x or longitude and y or latitude in `crs`; sigmas NaN where it gives none."""

    anchor: str
    x: float
    y: float
    crs: str
    sigma_m: float = math.nan
    image: str = ""
    image_sigma_m: float = math.nan
    kind: str = ""
    signature: str = ""


@dataclass(frozen=True, slots=True)
class RefusedAnchor:
    """An anchor that was not taken, as it was stated, with the reason in one stable phrase and in detail."""

    row: AnchorRow
    reason: str
    detail: str


@dataclass(frozen=True, slots=True)
class LabelledAnchors:
    """A file's anchors in WGS84, in its order, and those refused."""

    anchors: tuple[AnchorLabelled, ...]
    refused: tuple[RefusedAnchor, ...]


def labelled(rows: Sequence[AnchorRow]) -> LabelledAnchors:
    """The rows in WGS84. Refused are numbers that are none, sigmas and positions out of range, and a name that the
    same image has elsewhere already; the same row twice counts once. Raises FrameRefused for an unknown CRS.
    """
    taken: dict[tuple[str, str], AnchorLabelled] = {}
    refused: list[RefusedAnchor] = []
    for row in rows:
        try:
            anchor = _labelled(row)
            known = taken.setdefault((anchor.anchor, anchor.image), anchor)
            if known != anchor:
                raise EventRejected(SAME_NAME, _elsewhere(known, anchor))
        except EventRejected as error:
            refused.append(RefusedAnchor(row, error.reason, error.detail))
    return LabelledAnchors(tuple(taken.values()), tuple(refused))


def _labelled(row: AnchorRow) -> AnchorLabelled:
    _require_texts(row)
    if not (math.isfinite(row.x) and math.isfinite(row.y)):
        raise EventRejected(NOT_FINITE, f"anchor {row.anchor!r} is at {row.x}, {row.y}: finite numbers are needed")
    lat_deg, lon_deg = _wgs84(row)
    return AnchorLabelled(
        anchor=row.anchor,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        sigma_m=_sigma(row.sigma_m, LABEL_SIGMA_M, row.anchor),
        image=row.image,
        image_sigma_m=_image_sigma(row),
        kind=row.kind,
        signature=row.signature,
        source_crs=row.crs,
        operation=transformation_between(source_crs=row.crs, target_crs=WGS84),
    )


def _require_texts(row: AnchorRow) -> None:
    if not row.anchor:
        raise EventRejected(NO_NAME, f"the anchor at {row.x}, {row.y} has no name: give it one as 'anchor' or 'id'")
    for text in (row.anchor, row.image, row.kind, row.signature):
        if len(text) > TEXT_LIMIT:
            raise EventRejected(OUT_OF_RANGE, f"anchor {row.anchor[:20]!r}: a text of {len(text)}, limit {TEXT_LIMIT}")


def _wgs84(row: AnchorRow) -> tuple[float, float]:
    """Latitude and longitude in degrees."""
    if row.crs == WGS84:
        lat_deg, lon_deg = row.y, row.x
    else:
        lon, lat = _transformed(row)
        lat_deg, lon_deg = float(lat[0]), float(lon[0])
    if not (abs(lat_deg) <= LATITUDE_LIMIT_DEG and abs(lon_deg) <= LONGITUDE_LIMIT_DEG):
        raise EventRejected(
            OUT_OF_RANGE,
            f"anchor {row.anchor!r} is at latitude {lat_deg:.9g}, longitude {lon_deg:.9g}, "
            f"limits {LATITUDE_LIMIT_DEG:g} and {LONGITUDE_LIMIT_DEG:g} degrees",
        )
    return lat_deg, lon_deg


def _transformed(row: AnchorRow) -> tuple[np.ndarray, np.ndarray]:
    transformation_between(source_crs=row.crs, target_crs=WGS84)  # an unknown CRS is the file's fault, not the row's
    try:
        return transform_coordinates(np.array([row.x]), np.array([row.y]), source_crs=row.crs, target_crs=WGS84)
    except FrameRefused as error:
        raise EventRejected(OUT_OF_RANGE, f"anchor {row.anchor!r}: {error}") from error


def _sigma(stated_m: float, default_m: float, anchor: str) -> float:
    sigma_m = default_m if math.isnan(stated_m) else stated_m
    if not SIGMA_SMALLEST_M <= sigma_m <= SIGMA_LARGEST_M:
        raise EventRejected(
            OUT_OF_RANGE,
            f"anchor {anchor!r} has a sigma of {sigma_m:g} m, outside {SIGMA_SMALLEST_M:g} to {SIGMA_LARGEST_M:g} m",
        )
    return sigma_m


def _image_sigma(row: AnchorRow) -> float:
    """0 for a survey: without an image, or said so."""
    if not row.image or row.image_sigma_m == 0.0:
        return 0.0
    return _sigma(row.image_sigma_m, IMAGE_SIGMA_M, row.anchor)


def _elsewhere(known: AnchorLabelled, other: AnchorLabelled) -> str:
    apart_m = distance_m(Wgs84Position(known.lat_deg, known.lon_deg), Wgs84Position(other.lat_deg, other.lon_deg))
    return (
        f"anchor {other.anchor!r} of image {other.image!r} is in the file already, {apart_m:.3f} m away or with "
        "other sigmas, kind or signature; the first one is kept"
    )


def distance_m(here: Wgs84Position, there: Wgs84Position) -> float:
    """Metres between two positions on the ellipsoid."""
    distances_m = geodesic_distances_m(
        here.lat_deg, here.lon_deg, lat_deg=np.array([there.lat_deg]), lon_deg=np.array([there.lon_deg])
    )
    return float(distances_m[0])


def middle_of(anchors: Sequence[AnchorLabelled]) -> AnchorLabelled:
    """The anchor nearest to the median of all: one that a few misplaced others cannot make an outlier."""
    lat_deg = np.array([anchor.lat_deg for anchor in anchors])
    lon_deg = np.array([anchor.lon_deg for anchor in anchors])
    apart_m = geodesic_distances_m(
        float(np.median(lat_deg)), float(np.median(lon_deg)), lat_deg=lat_deg, lon_deg=lon_deg
    )
    return anchors[int(np.argmin(apart_m))]


def near_map(anchors: Iterable[AnchorLabelled], frame: MapFrame) -> LabelledAnchors:
    """The anchors within FAR_LIMIT_M of the map's origin; the others refused with their distance."""
    origin = wgs84_from_map(MapPosition(0.0, 0.0), frame)
    near: list[AnchorLabelled] = []
    refused: list[RefusedAnchor] = []
    for anchor in anchors:
        away_m = distance_m(origin, Wgs84Position(anchor.lat_deg, anchor.lon_deg))
        if away_m <= FAR_LIMIT_M:
            near.append(anchor)
        else:
            refused.append(_too_far(anchor, away_m, frame))
    return LabelledAnchors(tuple(near), tuple(refused))


def _too_far(anchor: AnchorLabelled, away_m: float, frame: MapFrame) -> RefusedAnchor:
    row = AnchorRow(
        anchor=anchor.anchor,
        x=anchor.lon_deg,
        y=anchor.lat_deg,
        crs=WGS84,
        sigma_m=anchor.sigma_m,
        image=anchor.image,
        image_sigma_m=anchor.image_sigma_m,
        kind=anchor.kind,
        signature=anchor.signature,
    )
    detail = (
        f"anchor {anchor.anchor!r} at latitude {anchor.lat_deg:.6f}, longitude {anchor.lon_deg:.6f} is "
        f"{away_m / 1000.0:,.1f} km from the map's origin in {frame.crs}, limit {FAR_LIMIT_M / 1000.0:g} km: "
        "is its hemisphere, zone or axis order right?"
    )
    return RefusedAnchor(row, TOO_FAR, detail)


def content_name(payloads: Iterable[bytes], *, number: int) -> str:
    """A boot's name made of what is appended and of the `number` it is appended at: never used twice."""
    digest = hashlib.sha256(number.to_bytes(8, "big"))
    for payload in payloads:
        digest.update(len(payload).to_bytes(8, "big") + payload)
    return digest.hexdigest()[:BOOT_ID_DIGITS]

"""The landmarks of the map version an ortho layer was made of, as anchors by an image beside it."""

from collections.abc import Sequence

import numpy as np

from trigpoint.errors import InputError
from trigpoint.events.mapped import LandmarkSolved
from trigpoint.events.solved import SolvedMap
from trigpoint.geodesy.projection import MapFrame, transform_coordinates
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import logged_frame, logged_maps
from trigpoint_tiles.core.image_anchors import ImageAnchor, PlacedLandmark, image_anchors
from trigpoint_tiles.core.image_tiles import ImageRegistration


def anchors_by_image(log: EventLog, found: ImageRegistration) -> tuple[ImageAnchor, ...]:
    """The landmarks in tiles that tell, where the image shows them, in the layer's CRS.

    Raises InputError where the layer does not say which map version it is of, the log does not hold that version, or no
    landmark of it lies in a tile that tells.
    """
    solved = _version_of(log, found.map_version)
    anchors = image_anchors(found.tiles, _placed(solved.landmarks, logged_frame(log), found.crs))
    if not anchors:
        told = len(found.accepted)
        raise InputError(
            f"{told} of {len(found.tiles)} tiles tell where the image lies, and in those is none of the "
            f"{len(solved.landmarks)} landmarks of map version {solved.head.map_version}"
        )
    return anchors


def _version_of(log: EventLog, version: int | None) -> SolvedMap:
    if version is None:
        raise InputError("the ortho layer does not say which map version it is of: render it with `trigpoint ortho`")
    versions = {one.head.map_version: one for one in logged_maps(log)}
    if version not in versions:
        held = ", ".join(map(str, versions)) or "none"
        raise InputError(f"the ortho layer is of map version {version}; the log holds {held}")
    return versions[version]


def _placed(landmarks: Sequence[LandmarkSolved], frame: MapFrame, crs: str) -> tuple[PlacedLandmark, ...]:
    point_m = np.array([one.position_m for one in landmarks]).reshape(-1, 2)
    easting_m, northing_m = point_m[:, 0] + frame.origin_easting_m, point_m[:, 1] + frame.origin_northing_m
    if crs != frame.crs:
        easting_m, northing_m = transform_coordinates(easting_m, northing_m, source_crs=frame.crs, target_crs=crs)
    return tuple(
        PlacedLandmark(landmark=one.landmark, kind=one.kind, easting_m=east_m, northing_m=north_m)
        for one, east_m, north_m in zip(landmarks, easting_m.tolist(), northing_m.tolist(), strict=True)
    )

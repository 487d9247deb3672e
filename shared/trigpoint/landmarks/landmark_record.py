"""A landmark as a record of a database and back, field by field: there are many, and they are asked for often."""

from operator import attrgetter

from trigpoint.landmarks import tables
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.records import json_of_names, names_from_json

# In the order of the columns of `landmarks`, the feature id left out; the first is the geometry.
LandmarkRecord = tuple[
    object, str, str, str, float, float, float, float, float, float, float, float, float, float,
    int, str, int, int, int, str, str, int, int | None,
]  # fmt: skip

COLUMNS = tuple(column.name for column in tables.landmarks.columns if column.name != "fid")

_BEFORE_VEHICLES = attrgetter(*COLUMNS[1 : COLUMNS.index("vehicles")])
_BEFORE_ANCHORS = attrgetter(*COLUMNS[COLUMNS.index("vehicles") + 1 : COLUMNS.index("anchors")])
_AFTER_ANCHORS = attrgetter(*COLUMNS[COLUMNS.index("anchors") + 1 :])


def record_of(landmark: Landmark, geometry: bytes) -> tuple[object, ...]:
    """The values of `COLUMNS`, the geometry as the database keeps it."""
    return (
        geometry,
        *_BEFORE_VEHICLES(landmark),
        json_of_names(landmark.vehicles),
        *_BEFORE_ANCHORS(landmark),
        json_of_names(landmark.anchors),
        *_AFTER_ANCHORS(landmark),
    )


def landmark_of(record: LandmarkRecord, *, easting_m: float, northing_m: float) -> Landmark:
    """The landmark of a record, its geometry read before."""
    return Landmark(
        landmark=record[1],
        kind=record[2],
        signature=record[3],
        x_m=record[4],
        y_m=record[5],
        easting_m=easting_m,
        northing_m=northing_m,
        lat_deg=record[6],
        lon_deg=record[7],
        variance_x_m2=record[8],
        covariance_xy_m2=record[9],
        variance_y_m2=record[10],
        sigma_major_m=record[11],
        sigma_minor_m=record[12],
        ellipse_heading_rad=record[13],
        observation_count=record[14],
        vehicles=names_from_json(record[15]),
        first_seen_ns=record[16],
        last_seen_ns=record[17],
        anchored=bool(record[18]),
        anchors=names_from_json(record[19]),
        provenance=record[20],
        valid_from_version=record[21],
        valid_to_version=record[22],
    )

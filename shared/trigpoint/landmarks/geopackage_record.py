"""A landmark as a record of a GeoPackage and back, field by field: there are many, and they are asked for often."""

from operator import attrgetter

from trigpoint.landmarks import tables
from trigpoint.landmarks.geopackage_geometry import decoded_point, encoded_point
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.records import json_of_names, names_from_json

# In the order of the columns of `landmarks`, the feature id left out.
LandmarkRecord = tuple[
    bytes, str, str, str, float, float, float, float, float, float, float, float, float, float,
    int, str, int, int, int, str, str, int, int | None,
]  # fmt: skip

COLUMNS = tuple(column.name for column in tables.landmarks.columns if column.name != "fid")
INSERT_SQL = f"INSERT INTO landmarks ({', '.join(COLUMNS)}) VALUES ({', '.join('?' * len(COLUMNS))})"

_BEFORE_VEHICLES = attrgetter(*COLUMNS[1 : COLUMNS.index("vehicles")])
_BEFORE_ANCHORS = attrgetter(*COLUMNS[COLUMNS.index("vehicles") + 1 : COLUMNS.index("anchors")])
_AFTER_ANCHORS = attrgetter(*COLUMNS[COLUMNS.index("anchors") + 1 :])


def record_of(landmark: Landmark, *, srs_id: int) -> tuple[object, ...]:
    """The values `INSERT_SQL` binds."""
    return (
        encoded_point(landmark.easting_m, landmark.northing_m, srs_id=srs_id),
        *_BEFORE_VEHICLES(landmark),
        json_of_names(landmark.vehicles),
        *_BEFORE_ANCHORS(landmark),
        json_of_names(landmark.anchors),
        *_AFTER_ANCHORS(landmark),
    )


def landmark_of(record: LandmarkRecord) -> Landmark:
    """The landmark of a record."""
    easting_m, northing_m = decoded_point(record[0])
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

"""Map rows as table records and back: geometry from positions, lists as JSON text."""

import json
from collections.abc import Mapping
from dataclasses import fields
from functools import lru_cache

from trigpoint.landmarks.geopackage_geometry import Coordinates
from trigpoint.landmarks.model import Anchor, ImageOffset, LabelGain, MapVersion, Trajectory

Record = dict[str, object]


def _plain(row: Trajectory | Anchor | ImageOffset | LabelGain | MapVersion, *without: str) -> Record:
    return {field.name: getattr(row, field.name) for field in fields(row) if field.name not in without}


@lru_cache(maxsize=4096)
def names_from_json(names_json: str) -> tuple[str, ...]:
    """A JSON list of names."""
    return tuple(json.loads(names_json))


@lru_cache(maxsize=4096)
def json_of_names(names: tuple[str, ...]) -> str:
    """A JSON list of names, as it is read by a person."""
    return json.dumps(names, ensure_ascii=False)


def trajectory_record(trajectory: Trajectory, srs_id: int) -> Record:
    """The record of a trajectory; without geometry if it has fewer than two poses, which is no line."""
    line = (srs_id, trajectory.path) if len(trajectory.path) > 1 else None
    return _plain(trajectory, "path") | {"geom": line}


def anchor_record(anchor: Anchor, srs_id: int) -> Record:
    """The record of an anchor; without geometry if its label's position is not known."""
    known = anchor.easting_m is not None and anchor.northing_m is not None
    point = (srs_id, ((anchor.easting_m, anchor.northing_m),)) if known else None
    return _plain(anchor, "easting_m", "northing_m") | {"geom": point}


def plain_record(row: ImageOffset | LabelGain | MapVersion) -> Record:
    """The record of a row without geometry."""
    return _plain(row)


def trajectory_of(record: Mapping[str, object]) -> Trajectory:
    """The trajectory of a record."""
    values = _values(record, Trajectory)
    return Trajectory(**values, path=_points(record))  # type: ignore[arg-type]


def anchor_of(record: Mapping[str, object]) -> Anchor:
    """The anchor of a record."""
    points = _points(record)
    easting_m, northing_m = points[0] if points else (None, None)
    return Anchor(**_values(record, Anchor), easting_m=easting_m, northing_m=northing_m)  # type: ignore[arg-type]


def image_offset_of(record: Mapping[str, object]) -> ImageOffset:
    """The image offset of a record."""
    return ImageOffset(**_values(record, ImageOffset))  # type: ignore[arg-type]


def label_gain_of(record: Mapping[str, object]) -> LabelGain:
    """The label gain of a record."""
    return LabelGain(**_values(record, LabelGain))  # type: ignore[arg-type]


def map_version_of(record: Mapping[str, object]) -> MapVersion:
    """The map version of a record."""
    return MapVersion(**_values(record, MapVersion))  # type: ignore[arg-type]


def _values(
    record: Mapping[str, object], kind: type[Trajectory | Anchor | ImageOffset | LabelGain | MapVersion]
) -> Record:
    return {field.name: record[field.name] for field in fields(kind) if field.name in record}


def _points(record: Mapping[str, object]) -> Coordinates:
    geometry = record["geom"]
    return geometry[1] if isinstance(geometry, tuple) else ()

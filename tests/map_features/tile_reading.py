"""Vector tiles as GDAL reads them: an encoder is not checked by its own inverse."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pyogrio import raw as ogr
from shapely import from_wkb
from shapely.geometry.base import BaseGeometry


@dataclass(frozen=True, slots=True)
class ReadFeature:
    """A feature's properties that have a value, and its geometry in the tile's units, y to the south."""

    properties: dict[str, Any]
    geometry: BaseGeometry


def read_tile(content: bytes, layer: str, folder: Path) -> list[ReadFeature]:
    """The features of a tile's layer; none for an empty tile."""
    if not content:
        return []
    file = folder / "tile.mvt"
    file.write_bytes(content)
    meta, _, geometries, columns = ogr.read(file, layer=layer, CLIP="NO")  # what is in the buffer too
    names = [str(name) for name in meta["fields"]]
    return [
        ReadFeature(
            {name: column[index] for name, column in zip(names, columns, strict=True) if _is_there(column[index])},
            from_wkb(geometry),
        )
        for index, geometry in enumerate(geometries)
    ]


def _is_there(value: Any) -> bool:
    return value is not None and value == value and value != ""

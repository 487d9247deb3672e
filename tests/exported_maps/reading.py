"""Exported files as other libraries read them: GDAL, and Arrow for GeoParquet, which GDAL's builds mostly lack."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pyogrio
from numpy.typing import NDArray
from shapely import from_wkb, get_coordinates

SUFFIXES = {"gpkg": "gpkg", "geojson": "geojson", "geoparquet": "parquet", "csv": "csv", "kml": "kml"}


@dataclass(frozen=True, slots=True)
class ReadLayer:
    """A layer: its columns, its geometries as objects of shapely, and what is said of its CRS."""

    columns: dict[str, list[Any]]
    geometries: NDArray[np.object_]
    crs: str

    @property
    def places(self) -> dict[str, tuple[float, float]]:
        """The place of each landmark."""
        points = get_coordinates(self.geometries).tolist()
        return {name: (x, y) for name, (x, y) in zip(self.columns["landmark"], points, strict=True)}


def read_layer(path: Path, layer: str = "landmarks") -> ReadLayer:
    """A layer of an exported file."""
    if path.suffix == ".parquet":
        return _read_parquet(path)
    one_layer = path.suffix == ".csv"
    meta, _, geometries, columns = pyogrio.raw.read(path, layer=path.stem if one_layer else layer)
    names = [str(name) for name in meta["fields"]]
    values = {
        name: [_plain(value, path.suffix) for value in column] for name, column in zip(names, columns, strict=True)
    }
    return ReadLayer(values, from_wkb(geometries) if geometries is not None else np.array([]), str(meta["crs"]))


def _read_parquet(path: Path) -> ReadLayer:
    table = pq.read_table(path)
    geo = json.loads(table.schema.metadata[b"geo"])
    values = table.to_pydict()
    places = from_wkb(np.array(values.pop("geometry"), dtype=object))
    crs = geo["columns"]["geometry"]["crs"]
    return ReadLayer(values, places, f"{crs['id']['authority']}:{crs['id']['code']}" if "id" in crs else crs["name"])


def _plain(value: Any, suffix: str) -> Any:
    """A value as Python has it; of a text in CSV the apostrophe is taken away that keeps it from being a formula."""
    if isinstance(value, str) and suffix == ".csv":
        return value.removeprefix("'")
    return value.item() if isinstance(value, np.generic) else value


def without_ends(texts: Iterable[str]) -> list[str]:
    """Texts as GDAL gives those of XML, which loses white space at their ends."""
    return sorted(text.strip() for text in texts)

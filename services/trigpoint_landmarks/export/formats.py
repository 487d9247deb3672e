"""The formats a map is exported in, and a file of one written whole or not at all."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from trigpoint.durable_files import replace_durably, replaced_durably
from trigpoint.errors import InputError
from trigpoint_landmarks.export.csv_file import beside_csv, write_csv
from trigpoint_landmarks.export.export import Export
from trigpoint_landmarks.export.geojson_file import write_geojson
from trigpoint_landmarks.export.geopackage_file import write_geopackage
from trigpoint_landmarks.export.kml_file import write_kml

Write = Callable[[Path, Export], None]
Beside = Callable[[Path, Export], Iterable[tuple[Path, bytes]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A format: how it is written, and the files that go beside it; `degrees` is its usual or only CRS."""

    name: str
    title: str
    write: Write
    beside: Beside | None = None
    one_layer: bool = False
    degrees: bool = False
    degrees_only: bool = False


def _write_geoparquet(path: Path, export: Export) -> None:
    try:
        from trigpoint_landmarks.export.geoparquet_file import write_geoparquet
    except ModuleNotFoundError as error:
        if error.name != "pyarrow":
            raise
        raise InputError("geoparquet needs pyarrow: pip install 'trigpoint[geoparquet]'") from error
    write_geoparquet(path, export)


FORMATS: Mapping[str, Format] = {
    one.name: one
    for one in (
        Format(name="gpkg", title="a GeoPackage, all layers, styled for QGIS", write=write_geopackage),
        Format(name="geojson", title="GeoJSON, one layer", write=write_geojson, one_layer=True, degrees=True),
        Format(name="geoparquet", title="GeoParquet 1.1, one layer", write=_write_geoparquet, one_layer=True),
        Format(name="csv", title="CSV, one layer", write=write_csv, beside=beside_csv, one_layer=True),
        Format(name="kml", title="KML 2.2, all layers", write=write_kml, degrees=True, degrees_only=True),
    )
}


def write_file(form: Format, path: Path, export: Export, *, force: bool) -> tuple[Path, ...]:
    """The files written, each whole and on the disk; what is there already is replaced only by `force`.

    Raises InputError for a file that is there, a folder that is not, and for what a format cannot hold; OSError where
    it cannot be written.
    """
    beside = () if form.beside is None else tuple(form.beside(path, export))
    files = (path, *(other for other, _ in beside))
    there = [str(file) for file in files if file.exists()]
    if there and not force:
        raise InputError(f"{there[0]} is there already: --force replaces it")
    if not path.parent.is_dir():
        raise InputError(f"{path.parent}: no such folder")
    with replaced_durably(path) as partial:
        form.write(partial, export)
    for other, content in beside:
        replace_durably(other, content)
    return files

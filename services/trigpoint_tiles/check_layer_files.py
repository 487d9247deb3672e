"""The check layer as a file that GIS programs open, whole or not at all."""

import json
from pathlib import Path

from trigpoint.durable_files import replace_durably, replaced_durably
from trigpoint.errors import InputError
from trigpoint.geodesy.projection import needs_epoch
from trigpoint.landmarks.geopackage_file import UNDATED
from trigpoint.landmarks.geopackage_writing import ANY_METADATA, GeoPackageWriting, WrittenTable, written_geopackage
from trigpoint_tiles.core.check_layer import COLUMNS, check_layer, check_values
from trigpoint_tiles.core.check_style import check_style
from trigpoint_tiles.core.image_tiles import ImageRegistration

GEOPACKAGE = ".gpkg"
TABLE = "image_shifts"
TITLE = "Shift of an aerial image"


def write_check_layer(path: Path, found: ImageRegistration, *, image: str) -> None:
    """The tiles in a file, in place of one that is there: a GeoPackage in the CRS of the ortho layer, styled for QGIS,
    where its name ends in .gpkg, GeoJSON in degrees otherwise.

    Raises InputError for a place that cannot be written to, ServiceError and DatabaseUnavailable for what SQLite cannot
    write.
    """
    if not path.parent.is_dir():
        raise InputError(f"{path}: cannot be written: {path.parent} is no folder")
    try:
        if path.suffix.lower() != GEOPACKAGE:
            replace_durably(path, check_layer(found, image=image).encode())
            return
        with replaced_durably(path) as partial:
            _write_geopackage(partial, found, image)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error}") from error


def _write_geopackage(path: Path, found: ImageRegistration, image: str) -> None:
    epoch = found.coordinate_epoch if needs_epoch(found.crs) else None
    with written_geopackage(path, crs=found.crs, epoch=epoch, changed=UNDATED) as file:
        _write_tiles(file, found, image)
        said = {"image": image, "map_version": found.map_version, "crs": found.crs, "pixel_m": found.pixel_m}
        file.describe(json.dumps(said, ensure_ascii=False), mime_type="application/json", standard=ANY_METADATA)


def _write_tiles(file: GeoPackageWriting, found: ImageRegistration, image: str) -> None:
    table = WrittenTable(
        name=TABLE,
        title=TITLE,
        description=f"Where {image} shows the ground, less where the ortho layer has it, in tiles",
        geometry_name="POINT",
        columns=tuple(COLUMNS.items()),
    )
    rows = (
        (((tile.easting_m, tile.northing_m),), [values[name] for name in COLUMNS])
        for tile, values in zip(found.tiles, check_values(found, image=image), strict=True)
    )
    file.write(table, [rows])
    file.style(TABLE, TITLE, check_style())

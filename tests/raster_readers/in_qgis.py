"""The layer as QGIS draws it, beside a layer of points."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rasterio.warp import transform

from qgis_reading.project import ran_in_qgis
from raster_readers.in_files import WINDOW_M, web_pixel_m, web_radius_px
from raster_readers.marks import MARKS_M, PIXEL_M, MarkedLayer, marks_deg
from raster_readers.misfit import grey_of, places_in, worst_px
from scanned_drives.examples import FRAME

DRAWING = Path(__file__).with_name("drawing.py")
MAGNIFIED = 4  # pixels of the picture to one of the layer
MARGIN_M = 4.0


def cog_in_qgis(layer: MarkedLayer) -> float:
    """How far the worst mark is drawn from its point in the COG, in pixels of that."""
    folder = _drawn(layer, "cog", ("gdal", str(layer.cog)), crs=FRAME.crs, pixel_m=PIXEL_M)
    return _worst(folder, "cog", radius_px=WINDOW_M / PIXEL_M)


def pictures_in_qgis(layer: MarkedLayer) -> float:
    """The same of the folder of XYZ tiles, in pixels of its finest zoom."""
    pixel_m = web_pixel_m(layer.zoom)
    source = f"type=xyz&url=file://{layer.pictures}/{{z}}/{{x}}/{{y}}.png&zmin=0&zmax={layer.zoom}"
    folder = _drawn(layer, "xyz", ("wms", source), crs="EPSG:3857", pixel_m=pixel_m)
    return _worst(folder, "xyz", radius_px=web_radius_px(layer.zoom))


def _drawn(layer: MarkedLayer, name: str, raster: tuple[str, str], *, crs: str, pixel_m: float) -> Path:
    folder = layer.folder / f"qgis-{name}"
    folder.mkdir(exist_ok=True)
    place_m = np.column_stack(transform("EPSG:4326", crs, *marks_deg().T))
    west, south = (place_m.min(axis=0) - MARGIN_M).tolist()
    east, north = (place_m.max(axis=0) + MARGIN_M).tolist()
    screen_m = pixel_m / MAGNIFIED
    columns, rows = round((east - west) / screen_m), round((north - south) / screen_m)
    asked: dict[str, Any] = {
        "crs": crs,
        "box": [west, south, west + columns * screen_m, south + rows * screen_m],
        "size_px": [columns, rows],
        "points": str(layer.points),
        "rasters": {name: raster},
        "folder": str(folder),
    }
    ran_in_qgis(DRAWING, json.dumps(asked))
    return folder


def _worst(folder: Path, name: str, *, radius_px: float) -> float:
    shown, points = (_grey(folder / f"{one}.png") for one in (name, "points"))
    places = places_in(points, count=len(MARKS_M))
    return worst_px(shown, places, radius_px=radius_px * MAGNIFIED) / MAGNIFIED


def _grey(path: Path) -> NDArray[np.float64]:
    return grey_of(path.read_bytes())

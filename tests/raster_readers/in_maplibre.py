"""The layer as MapLibre draws it in Chromium, beside a layer of points."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser

from raster_readers.file_server import serving_files
from raster_readers.in_files import TILE_PX, web_radius_px
from raster_readers.marks import MARKS_M, MarkedLayer, marks_deg
from raster_readers.misfit import grey_of, places_in, worst_px
from trigpoint_landmarks.http.viewer_files import BUILT
from viewed_maps.browser import Viewed, viewed

PACKAGES = BUILT.parent / "node_modules"
MAGNIFIED_ZOOMS = 2
MAGNIFIED = 1 << MAGNIFIED_ZOOMS  # pixels of the screen to one of the layer
MAP_ZOOM = -1  # MapLibre's zoom has tiles of 512 pixels
POINT = {"type": "circle", "paint": {"circle-radius": 8, "circle-color": "#ffffff"}}
RASTER = {"type": "raster", "paint": {"raster-fade-duration": 0}}
WIDTH, HEIGHT = 1000, 1000


@dataclass(frozen=True, slots=True)
class MapPage:
    """A page that shows one layer at a time, and where it finds the files."""

    shown: Viewed
    url: str
    layer: MarkedLayer

    def pictures_off_px(self, zoom: int) -> float:
        """How far the worst mark is drawn from its point in the XYZ tiles of a zoom, in pixels of those."""
        tiles = [f"{self.url}/layer/xyz/{{z}}/{{x}}/{{y}}.png"]
        return self._worst({"type": "raster", "tileSize": TILE_PX, "maxzoom": zoom, "tiles": tiles}, zoom)

    def archive_off_px(self) -> float:
        """The same of the finest tiles of the PMTiles archive, which itself says what zooms it has."""
        source = {"type": "raster", "tileSize": TILE_PX, "url": f"pmtiles://{self.url}/layer/ortho.pmtiles"}
        return self._worst(source, self.layer.zoom)

    def _worst(self, source: dict[str, Any], zoom: int) -> float:
        points = {"type": "geojson", "data": json.loads(self.layer.points.read_text(encoding="utf-8"))}
        places = places_in(grey_of(self._drawn(points, POINT, zoom)), count=len(MARKS_M))
        picture = grey_of(self._drawn(source, RASTER, zoom))
        return worst_px(picture, places, radius_px=web_radius_px(zoom) * MAGNIFIED) / MAGNIFIED

    def _drawn(self, source: dict[str, Any], layer: dict[str, Any], zoom: int) -> bytes:
        look = {
            "source": source,
            "layer": layer,
            "center": marks_deg().mean(axis=0).tolist(),
            "zoom": zoom + MAGNIFIED_ZOOMS + MAP_ZOOM,
        }
        self.shown.page.evaluate("look => window.show(look)", look)
        return self.shown.page.locator("#map canvas").screenshot()


@contextmanager
def map_page(browser: Browser, layer: MarkedLayer) -> Iterator[MapPage]:
    """An empty page with MapLibre, which can read the layer's files."""
    mounts = {
        "layer": layer.folder,
        "page": Path(__file__).parent,
        "maplibre-gl": PACKAGES / "maplibre-gl",
        "pmtiles": PACKAGES / "pmtiles",
    }
    with serving_files(mounts) as url, viewed(browser, width=WIDTH, height=HEIGHT) as shown:
        shown.page.goto(f"{url}/page/page.html")
        shown.page.wait_for_function("typeof window.show === 'function'")
        yield MapPage(shown, url, layer)

"""Bright marks on dark ground at known places: driven past, and rendered to every format there is."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from command_runs.running import trigpoint
from scanned_drives.examples import FRAME, arc, drive_rows, map_rows, pinned, solved_path
from trigpoint.geodesy.projection import wgs84_from_map_points
from trigpoint.logs.mcap_log import McapLog

Floats = NDArray[np.float64]

PIXEL_M = 0.2
MARK_RADIUS_M = 1.0
AROUND_M = 3.0  # of a mark, where points fall
DARK, BRIGHT = 10.0, 100.0
POSES = arc(2.0)
# Off the pixels' corners and middles, each by something else, in a box of some 20 m that the vehicle drives along.
MARKS_M = np.array(
    [
        [103.137, 212.291],
        [110.613, 211.047],
        [117.889, 213.713],
        [102.371, 204.959],
        [109.451, 203.107],
        [118.233, 206.533],
        [104.029, 196.817],
        [111.777, 195.381],
        [119.101, 198.149],
    ]
)


@dataclass(frozen=True, slots=True)
class MarkedLayer:
    """The files of the layer, and `points`, the marks' places in WGS84 as GeoJSON."""

    folder: Path
    zoom: int

    @property
    def cog(self) -> Path:
        """The Cloud Optimized GeoTIFF."""
        return self.folder / "ortho.tif"

    @property
    def archive(self) -> Path:
        """The PMTiles archive."""
        return self.folder / "ortho.pmtiles"

    @property
    def pictures(self) -> Path:
        """The folder of XYZ tiles."""
        return self.folder / "xyz"

    @property
    def points(self) -> Path:
        """The reference layer."""
        return self.folder / "marks.geojson"


def marks_deg() -> Floats:
    """Longitude and latitude (n, 2) of the marks."""
    lat_deg, lon_deg = wgs84_from_map_points(MARKS_M, FRAME)
    return np.column_stack([lon_deg, lat_deg])


def marked_ground(around_m: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Points (n, 3) on flat ground near the marks, as many as places are given, and how bright the ground is there."""
    nearest = MARKS_M[random.integers(0, len(MARKS_M), len(around_m))]
    off_m = random.uniform(-AROUND_M, AROUND_M, around_m.shape)
    bright = np.where(np.hypot(*off_m.T) < MARK_RADIUS_M, BRIGHT, DARK)
    return np.column_stack([nearest + off_m, np.zeros(len(off_m))]), bright


def marked_layer(folder: Path) -> MarkedLayer:
    """The layer in a new folder, as `trigpoint ortho render` makes it of a log. Raises AssertionError."""
    log = McapLog(folder / "data" / "log")
    log.append("map", [pinned()])
    log.append("veh-car", drive_rows("car", POSES, world=marked_ground))
    log.append("optimisation", map_rows([solved_path("car", POSES)]))
    log.close()
    words = ("--data", folder / "data", "--out", folder / "layer", "--resolution-m", PIXEL_M, "--json")
    run = trigpoint("ortho", "render", *words)
    assert run.status == 0, run.err
    zoom = next(grid["zoom"] for grid in run.answer["grids"] if grid["zoom"] is not None)
    layer = MarkedLayer(folder / "layer", int(zoom))
    features = [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": place}}
        for place in marks_deg().tolist()
    ]
    layer.points.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")
    return layer

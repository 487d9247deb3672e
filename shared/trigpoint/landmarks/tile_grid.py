"""A vector tile's own grid: where the world's positions fall on it, and what of them a tile shows."""

from dataclasses import dataclass

from trigpoint.errors import InputError
from trigpoint.geodesy.web_tiles import MERCATOR_LIMIT_DEG, WebTile, corner_of
from trigpoint.landmarks.layers import Layer
from trigpoint.landmarks.queries import DegreeBox

EXTENT = 4096  # units on a tile's side
BUFFER = 64  # units beyond each side: a symbol on the edge is drawn in both tiles
CELL = 64  # units: where there are many, one point stands for all in its cell; divides the extent and the buffer
CROWDED_ZOOM = 14  # up to here points of a cell are drawn as one: 64 units are then 4 pixels, 32 m at Sydney
ZOOM_MOST = 24

# What is said of a feature in a tile; `left_out`: how many more are in the cell of the one that is shown.
TILE_PROPERTIES: dict[str, tuple[str, ...]] = {
    "landmarks": (
        "landmark",
        "kind",
        "sigma_major_m",
        "sigma_minor_m",
        "ellipse_heading_rad",
        "observation_count",
        "anchored",
        "left_out",
    ),
    "trajectories": ("vehicle", "boot_id", "length_m", "first_stamp_ns", "last_stamp_ns"),
    "anchors": (
        "anchor",
        "image",
        "kind",
        "landmark",
        "reason",
        "sigma_m",
        "residual_x_m",
        "residual_y_m",
        "residual_m",
        "left_out",
    ),
}
# Of the points in a cell the first in this order stands for the others.
PRECEDENCE: dict[str, tuple[str, ...]] = {
    "landmarks": ("sigma_major_m", "landmark"),
    "anchors": ("anchor", "image"),
}


@dataclass(frozen=True, slots=True)
class TileFrame:
    """A tile's grid: the world has `world` units on a side; the tile's own begin at `left`, `top`."""

    world: int
    left: int
    top: int


def tile_frame(tile: WebTile) -> TileFrame:
    """The grid of a tile."""
    return TileFrame(EXTENT << tile.zoom, EXTENT * tile.column, EXTENT * tile.row)


def require_tile(zoom: int, column: int, row: int) -> WebTile:
    """The tile, if there is one. Raises InputError, saying how many there are."""
    if not 0 <= zoom <= ZOOM_MOST:
        raise InputError(f"zoom {zoom} is outside 0 to {ZOOM_MOST}")
    if not (0 <= column < 1 << zoom and 0 <= row < 1 << zoom):
        raise InputError(f"tile {zoom}/{column}/{row} is outside 0 to {(1 << zoom) - 1}")
    return WebTile(zoom, column, row)


def is_crowded(layer: Layer, tile: WebTile) -> bool:
    """Whether points of one cell are drawn as one."""
    return layer.geometry == "Point" and tile.zoom <= CROWDED_ZOOM


def buffered_box(tile: WebTile) -> DegreeBox:
    """A box that holds the tile and its buffer, a unit wider for what is rounded into it."""
    share = (BUFFER + 1) / EXTENT
    west, north = corner_of(tile.zoom, tile.column - share, tile.row - share)
    east, south = corner_of(tile.zoom, tile.column + 1 + share, tile.row + 1 + share)
    return DegreeBox(
        lon_min_deg=max(west, -180.0),
        lat_min_deg=max(south, -MERCATOR_LIMIT_DEG),
        lon_max_deg=min(east, 180.0),
        lat_max_deg=min(north, MERCATOR_LIMIT_DEG),
    )

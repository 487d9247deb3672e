"""Two map versions, between which an anchor moved a street by half a metre, rendered one upon the other and anew."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rasterio
from numpy.typing import NDArray

from scanned_drives.examples import World, arc, drive_rows, map_rows, painted_ground, scanned_log, solved_path
from trigpoint.logs.memory_log import MemoryLog
from trigpoint_tiles.app import render_ortho
from trigpoint_tiles.core.grid import TILE_PX
from trigpoint_tiles.settings import TilesSettings

Floats = NDArray[np.float64]

MOVED_M, WAVE_M = 0.5, 8.0
STREET, SETTINGS = arc(16.0), TilesSettings(resolution_m=0.2, memory_bytes=512 * 1024**2, zooms=3)
OTHER_STREET = arc(3.0, start=(400.0, 200.0, 0.3))


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderedAnew:
    """Of the raster in the map's CRS: tiles in all, those touched, and those that are the very same as in a full
    render."""

    tiles: int
    touched: int
    equal: int


def smooth_ground(around_m: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Flat ground around places (n, 2), bright in waves so long that a bent path does not make it darker as a whole:
    else the drive's gain changes, and all its tiles are rendered."""
    point_m, _ = painted_ground(around_m, random)
    return point_m, 50.0 + 10.0 * np.sin(point_m[:, 0] / WAVE_M)


def whole_street() -> Floats:
    """Another street, all of which moved."""
    return np.asarray(OTHER_STREET + np.array([MOVED_M, 0.0, 0.0]))


def bent_street() -> Floats:
    """The street, whose middle moved to its side, less and less to either end, which stayed."""
    share = np.clip(1.5 - 3.0 * np.abs(np.linspace(-1.0, 1.0, len(STREET))), 0.0, 1.0)
    aside = np.column_stack([-np.sin(STREET[:, 2]), np.cos(STREET[:, 2]), np.zeros(len(STREET))])
    return np.asarray(STREET + MOVED_M * share[:, None] * aside)


def two_versions(before: Floats, after: Floats, *, world: World = painted_ground) -> tuple[MemoryLog, MemoryLog]:
    """A drive along a street that stays and one along a path that moves, with the first map version and with both."""
    still = arc(5.0, start=(100.0, 500.0, 0.3))
    van = drive_rows("van", before, world=world, seed=2, gain=1.5)
    rows = {"car": drive_rows("car", still, world=world), "van": van}
    first = scanned_log(rows, [solved_path("car", still), solved_path("van", before)])
    second = scanned_log(rows, [solved_path("car", still), solved_path("van", before)])
    paths = [solved_path("car", still, map_version=2), solved_path("van", after, map_version=2)]
    second.append("optimisation", map_rows(paths, map_version=2))
    return first, second


def rendered_anew(folder: Path, before: Floats, after: Floats, *, world: World = painted_ground) -> RenderedAnew:
    """What the second version touches upon the first, beside a full render of it."""
    first, second = two_versions(before, after, world=world)
    render_ortho(first, folder / "kept", settings=SETTINGS, formats=("cog",))
    found = render_ortho(second, folder / "kept", settings=SETTINGS, formats=("cog",)).grids[0].brought_up
    render_ortho(second, folder / "whole", settings=SETTINGS, formats=("cog",))
    kept, whole = (_bands(folder / name / "ortho.tif") for name in ("kept", "whole"))
    column, row = min(tile.column for tile in found.tiles), min(tile.row for tile in found.tiles)
    equal = sum(
        np.array_equal(
            _tile(kept, tile.column - column, tile.row - row),
            _tile(whole, tile.column - column, tile.row - row),
            equal_nan=True,
        )
        for tile in found.tiles
    )
    return RenderedAnew(tiles=len(found.tiles), touched=len(found.rendered), equal=equal)


def _bands(path: Path) -> NDArray[np.float32]:
    with rasterio.open(path) as raster:
        return np.asarray(raster.read())


def _tile(bands: NDArray[np.float32], column: int, row: int) -> NDArray[np.float32]:
    return bands[:, row * TILE_PX : (row + 1) * TILE_PX, column * TILE_PX : (column + 1) * TILE_PX]

"""The tiles of one grid on disk, brought up to a map version: only what changed is gathered and rendered again."""

import json
import shutil
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np

from trigpoint.durable_files import replace_durably
from trigpoint.errors import InputError
from trigpoint.geodesy.projection import MapFrame
from trigpoint.geodesy.web_tiles import WebTile, tile_edges_deg, tile_size_m
from trigpoint.logs.ports import RecallingLog
from trigpoint_tiles.clouds import DriveClouds
from trigpoint_tiles.core.balance import Brightness, balanced_gains, brightness
from trigpoint_tiles.core.cells import Cells
from trigpoint_tiles.core.grid import TILE_PX, RasterGrid, Tile
from trigpoint_tiles.core.part_form import bands_bytes, bands_from
from trigpoint_tiles.core.rendering import Bands, rendered
from trigpoint_tiles.drive_gathering import DriveGatherer, GatheredDrive, SweepCounts, SweepDone
from trigpoint_tiles.part_files import DriveParts
from trigpoint_tiles.settings import TilesSettings

FORM = 1  # of what stands in the folder; another one is made anew
STATE = "state.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class BroughtUp:
    """What there is now: all tiles, those rendered now and those gone, each drive's gain and counts, by name."""

    tiles: frozenset[Tile]
    rendered: frozenset[Tile]
    gone: frozenset[Tile]
    gains: Mapping[str, float]
    counts: Mapping[str, SweepCounts]


class GridLayer:
    """A folder with each drive's parts, each tile's bands, and what they were made from."""

    def __init__(self, folder: Path, frame: MapFrame, grid: RasterGrid, settings: TilesSettings) -> None:
        self._folder, self._frame, self._grid, self._settings = folder, frame, grid, settings

    def bring_up(self, log: RecallingLog, drives: Iterable[DriveClouds], *, progress: SweepDone) -> BroughtUp:
        """The tiles of the drives as their paths are now. Raises InputError."""
        before = self._state()
        if before is None:
            shutil.rmtree(self._folder / "bands", ignore_errors=True)
        (self._folder / STATE).unlink(missing_ok=True)  # until all is done
        gatherer = DriveGatherer(log, self._frame, self._grid, self._settings)
        found: dict[str, GatheredDrive] = {}
        for clouds in drives:
            parts = DriveParts(self._drive_folder(clouds))
            found[str(clouds.name)] = gatherer.gathered(clouds, parts, progress=progress)
        changed = self._without_drives({one.parts.folder for one in found.values()})
        changed |= frozenset[Tile]().union(*(one.changed for one in found.values()))
        return self._rendered(found, changed, before or {})

    def bands(self, tile: Tile) -> Bands:
        """A rendered tile's bands (5, 256, 256). Raises InputError for a damaged file."""
        path = self._bands_path(tile)
        try:
            return bands_from(path.read_bytes())
        except InputError as error:
            raise InputError(f"{path}: {error}; remove {self._folder} to make it again") from error

    def all_bands(self, tiles: Iterable[Tile]) -> Iterator[tuple[Tile, Bands]]:
        """Tiles with their bands, from north to south."""
        for tile in sorted(tiles, key=lambda tile: (tile.row, tile.column)):
            yield tile, self.bands(tile)

    def _rendered(
        self, drives: Mapping[str, GatheredDrive], changed: frozenset[Tile], before: Mapping[str, Any]
    ) -> BroughtUp:
        tiles_by_drive = {name: one.parts.tiles() for name, one in drives.items()}
        tiles = frozenset[Tile]().union(*tiles_by_drive.values())
        bright = {tile: known for tile, known in _known_brightness(before).items() if tile in tiles - changed}
        for tile in tiles - bright.keys():
            bright[tile] = brightness(
                {n: one.parts.cells(tile) for n, one in drives.items() if tile in tiles_by_drive[n]}
            )
        gains = balanced_gains([bright[tile] for tile in sorted(bright)])
        brighter = [name for name, gain in gains.items() if before.get("gains", {}).get(name) != gain]
        anew = (changed & tiles).union(*(tiles_by_drive[name] for name in brighter))
        anew |= {tile for tile in tiles if not self._bands_path(tile).exists()}
        for tile in anew:
            here = {name: one.parts.cells(tile) for name, one in drives.items() if tile in tiles_by_drive[name]}
            self._write_bands(tile, here, gains)
        gone = changed - tiles
        for tile in gone:
            self._bands_path(tile).unlink(missing_ok=True)
        self._write_state(gains, bright)
        counts = {name: one.counts for name, one in drives.items()}
        return BroughtUp(tiles=tiles, rendered=frozenset(anew), gone=gone, gains=gains, counts=counts)

    def _write_bands(self, tile: Tile, drives: Mapping[str, Cells], gains: Mapping[str, float]) -> None:
        names = sorted(drives)
        bands = rendered(
            [drives[name] for name in names],
            [gains[name] for name in names],
            pixel_area_m2=_ground_pixel_m(self._grid, tile) ** 2,
        )
        path = self._bands_path(tile)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(bands_bytes(bands))

    def _bands_path(self, tile: Tile) -> Path:
        return self._folder / "bands" / f"{tile.column}_{tile.row}.bands"

    def _drive_folder(self, clouds: DriveClouds) -> Path:
        return self._folder / "drives" / f"veh-{clouds.name.vehicle}" / f"boot-{clouds.name.boot_id}"

    def _without_drives(self, present: set[Path]) -> frozenset[Tile]:
        """The tiles of drives that are there no more, whose parts go."""
        gone = frozenset[Tile]()
        for folder in (self._folder / "drives").glob("veh-*/boot-*"):
            if folder not in present:
                gone |= DriveParts(folder).tiles()
                shutil.rmtree(folder)
        return gone

    def _identity(self) -> str:
        """What the parts depend on besides sweeps and paths."""
        chosen = self._settings
        made_of = (FORM, repr(self._grid), repr(self._frame), chosen.range_least_m, chosen.range_most_m, chosen.deskew)
        return blake2b(repr(made_of).encode(), digest_size=16).hexdigest()

    def _state(self) -> Mapping[str, Any] | None:
        """What the folder says of itself, None where it was not finished; one made otherwise is emptied."""
        try:
            named = (self._folder / "identity").read_text(encoding="utf-8")
        except FileNotFoundError:
            named = ""
        if named != self._identity():
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder.mkdir(parents=True)
            replace_durably(self._folder / "identity", self._identity().encode())
        try:
            state: Mapping[str, Any] = json.loads((self._folder / STATE).read_text(encoding="utf-8"))
            return state
        except (FileNotFoundError, json.JSONDecodeError):
            return None

    def _write_state(self, gains: Mapping[str, float], bright: Mapping[Tile, Brightness]) -> None:
        tiles = [
            [tile.column, tile.row, dict(one.levels), [[*names, *ratio] for names, ratio in one.ratios.items()]]
            for tile, one in sorted(bright.items())
        ]
        replace_durably(self._folder / STATE, json.dumps({"gains": gains, "brightness": tiles}).encode())


def _known_brightness(state: Mapping[str, Any]) -> dict[Tile, Brightness]:
    return {
        Tile(column, row): Brightness(
            levels={name: (total, count) for name, (total, count) in levels.items()},
            ratios={(first, second): (total, count) for first, second, total, count in ratios},
        )
        for column, row, levels, ratios in state.get("brightness", [])
    }


def _ground_pixel_m(grid: RasterGrid, tile: Tile) -> float:
    """The side of a tile's pixels on the ground; a projected CRS is taken as true to scale."""
    if grid.zoom is None:
        return grid.pixel_m
    _, south, _, north = tile_edges_deg(WebTile(grid.zoom, tile.column, tile.row))
    return float(tile_size_m(np.array([0.5 * (south + north)]), grid.zoom)[0]) / TILE_PX

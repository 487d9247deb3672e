"""The tiles of one grid on disk, brought up to a map version: only what changed is gathered and rendered again."""

import json
import shutil
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from hashlib import blake2b
from pathlib import Path
from typing import Any

from trigpoint.durable_files import replace_durably
from trigpoint.geodesy.projection import MapFrame
from trigpoint.logs.ports import RecallingLog
from trigpoint_tiles.clouds import DriveClouds
from trigpoint_tiles.core.balance import Brightness, balanced_gains
from trigpoint_tiles.core.grid import RasterGrid, Tile
from trigpoint_tiles.core.rendering import Bands
from trigpoint_tiles.drive_gathering import PieceGathering, SweepCounts, SweepDone
from trigpoint_tiles.drive_plans import DrivePlan, DrivePlanner
from trigpoint_tiles.hands import Hands, own_hands
from trigpoint_tiles.part_files import DriveParts
from trigpoint_tiles.settings import TilesSettings
from trigpoint_tiles.tile_rendering import BandsFolder, SeenTile, brightness_of, together

FORM = 2  # of what stands in the folder; another one is made anew
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
        self._folder, self._frame, self._grid, self._settings = folder.absolute(), frame, grid, settings
        self._bands = BandsFolder(self._folder / "bands", grid)

    def bring_up(
        self,
        log: RecallingLog,
        drives: Iterable[DriveClouds],
        *,
        progress: SweepDone,
        hands: Hands | None = None,
    ) -> BroughtUp:
        """The tiles of the drives as their paths are now, done by `hands`, the caller's own where none are given;
        `progress` is told of sweeps.

        What a worker's death cost is done again by another. Raises InputError, and ServiceError where that failed too:
        once everything else is done, so that the next time little is left.
        """
        chosen, before = hands or own_hands(log), self._state()
        if before is None:
            shutil.rmtree(self._bands.folder, ignore_errors=True)
        (self._folder / STATE).unlink(missing_ok=True)  # until all is done
        self._bands.folder.mkdir(parents=True, exist_ok=True)
        plans = self._gathered(drives, chosen, progress)
        changed = self._without_drives({plan.parts.folder for plan in plans.values()})
        changed |= frozenset[Tile]().union(*(plan.changed for plan in plans.values()))
        return self._rendered(plans, changed, before or {}, _TileWork(chosen))

    def bands(self, tile: Tile) -> Bands:
        """A rendered tile's bands (5, 256, 256). Raises InputError for a damaged file."""
        return self._bands.read(tile)

    def all_bands(self, tiles: Iterable[Tile]) -> Iterator[tuple[Tile, Bands]]:
        """Tiles with their bands, from north to south."""
        for tile in sorted(tiles, key=lambda tile: (tile.row, tile.column)):
            yield tile, self.bands(tile)

    @property
    def bands_folder(self) -> BandsFolder:
        """Where the bands stand, for workers elsewhere."""
        return self._bands

    @property
    def zoom(self) -> int:
        """That of the web tiles these are, 0 for others."""
        return self._grid.zoom or 0

    def _gathered(self, drives: Iterable[DriveClouds], hands: Hands, progress: SweepDone) -> dict[str, DrivePlan]:
        planner = DrivePlanner(self._frame, self._grid, self._settings)
        plans = {str(one.name): planner.plan(one, DriveParts(self._drive_folder(one))) for one in drives}
        by_folder = {plan.parts.folder: plan for plan in plans.values()}
        heard = progress if hands.some.are_here else None
        gathering = PieceGathering(hands.open_log, self._frame, self._grid, self._settings, heard)
        pieces = (piece for plan in plans.values() for piece in plan.begun())
        for piece, gathered in hands.each("pieces of drives not gathered", gathering, pieces):
            by_folder[piece.folder].take(piece, gathered)
            if heard is None:
                progress(len(gathered.box))
        return plans

    def _rendered(
        self, drives: Mapping[str, DrivePlan], changed: frozenset[Tile], before: Mapping[str, Any], work: "_TileWork"
    ) -> BroughtUp:
        seen = _seen_tiles(drives)
        tiles = frozenset(seen)
        bright = {tile: known for tile, known in _known_brightness(before).items() if tile in tiles - changed}
        bright |= work.brightness([seen[tile] for tile in sorted(tiles - bright.keys())])
        gains = balanced_gains([bright[tile] for tile in sorted(bright)])
        brighter = {name for name, gain in gains.items() if before.get("gains", {}).get(name) != gain}
        anew = changed & tiles
        anew |= {one.tile for one in seen.values() if not brighter.isdisjoint(name for name, _ in one.drives)}
        anew |= {tile for tile in tiles if not self._bands.path(tile).exists()}
        work.render(self._bands, gains, [seen[tile] for tile in sorted(anew)])
        gone = changed - tiles
        for tile in gone:
            self._bands.path(tile).unlink(missing_ok=True)
        self._write_state(gains, bright)
        counts = {name: one.counts for name, one in drives.items()}
        return BroughtUp(tiles=tiles, rendered=anew, gone=gone, gains=gains, counts=counts)

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


@dataclass(frozen=True, slots=True)
class _TileWork:
    """Tiles done by hands."""

    hands: Hands

    def brightness(self, tiles: list[SeenTile]) -> dict[Tile, Brightness]:
        found: dict[Tile, Brightness] = {}
        for _, some in self.hands.each("groups of tiles not looked at", brightness_of, together(tiles)):
            found |= some
        return found

    def render(self, bands: BandsFolder, gains: Mapping[str, float], tiles: list[SeenTile]) -> None:
        done = 0
        write = partial(bands.write, gains)
        for some, _ in self.hands.each("groups of tiles not rendered", write, together(tiles)):
            done += len(some)
            self.hands.rendering(done, len(tiles))


def _seen_tiles(drives: Mapping[str, DrivePlan]) -> dict[Tile, SeenTile]:
    """Every tile with the drives that saw it."""
    folders: dict[Tile, list[tuple[str, Path]]] = {}
    for name, plan in sorted(drives.items()):
        for tile in plan.parts.tiles():
            folders.setdefault(tile, []).append((name, plan.parts.folder))
    return {tile: SeenTile(tile, tuple(found)) for tile, found in folders.items()}


def _known_brightness(state: Mapping[str, Any]) -> dict[Tile, Brightness]:
    return {
        Tile(column, row): Brightness(
            levels={name: (total, count) for name, (total, count) in levels.items()},
            ratios={(first, second): (total, count) for first, second, total, count in ratios},
        )
        for column, row, levels, ratios in state.get("brightness", [])
    }

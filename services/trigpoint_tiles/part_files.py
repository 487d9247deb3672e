"""Parts of tiles in folders: what each drive told each tile, until it is told anew."""

import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import count, takewhile
from pathlib import Path

import numpy as np

from trigpoint.durable_files import replaced_durably
from trigpoint.errors import InputError
from trigpoint_tiles.core.cells import FIELDS, Cells, merge_cells
from trigpoint_tiles.core.grid import TILE_PX, Tile
from trigpoint_tiles.core.movement import PlacedSweeps
from trigpoint_tiles.core.part_form import cells_from, part_bytes

ENDING = ".part"
RECORD = "sweeps.npz"


@dataclass(frozen=True, slots=True)
class DriveParts:
    """The parts of one drive on one grid, `<column>_<row>_<number>.part` each, in a folder of its own.

    Without its record the folder is of no use: whoever filled it did not finish.
    """

    folder: Path

    def begin(self, tiles: Iterable[Tile] | None) -> None:
        """Makes room for new parts of these tiles, None for all; without `finish` nothing of the drive counts."""
        self.folder.mkdir(parents=True, exist_ok=True)
        (self.folder / RECORD).unlink(missing_ok=True)
        if tiles is None:
            shutil.rmtree(self.folder)
            self.folder.mkdir()
            return
        for tile in tiles:
            for path in self._paths(tile):
                path.unlink()

    def add(self, tile: Tile, cells: Cells) -> None:
        """One more part of a tile."""
        number = len(self._paths(tile))
        (self.folder / f"{tile.column}_{tile.row}_{number}{ENDING}").write_bytes(part_bytes(cells))

    def finish(self, sweeps: PlacedSweeps) -> None:
        """Says that the parts are whole, and of which sweeps."""
        with replaced_durably(self.folder / RECORD) as path, path.open("wb") as file:
            np.savez(file, sequence=sweeps.sequence, pose=sweeps.pose, box=sweeps.box)

    def sweeps(self) -> PlacedSweeps | None:
        """What the parts are of, None where they are not whole."""
        try:
            with np.load(self.folder / RECORD) as record:
                return PlacedSweeps(sequence=record["sequence"], pose=record["pose"], box=record["box"])
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError) as error:
            raise InputError(f"{self.folder / RECORD}: no record of sweeps: {error}; remove the folder") from error

    def tiles(self) -> frozenset[Tile]:
        """The tiles that have parts."""
        stems = (path.stem.split("_") for path in self.folder.glob(f"*{ENDING}"))
        return frozenset(Tile(int(column), int(row)) for column, row, _ in stems)

    def cells(self, tile: Tile) -> Cells:
        """A tile's parts merged. Raises InputError for a damaged one."""
        total = np.zeros((TILE_PX, TILE_PX, FIELDS), dtype=np.int64)
        for path in self._paths(tile):
            try:
                merge_cells(total, cells_from(path.read_bytes()))
            except InputError as error:
                raise InputError(f"{path}: {error}; remove the folder to make it again") from error
        return total

    def _paths(self, tile: Tile) -> list[Path]:
        numbered = (self.folder / f"{tile.column}_{tile.row}_{number}{ENDING}" for number in count())
        return list(takewhile(Path.exists, numbered))

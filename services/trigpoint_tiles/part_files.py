"""Parts of tiles in folders: what each drive told each tile, until it is told anew."""

import shutil
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

import numpy as np

from trigpoint.durable_files import replaced_durably
from trigpoint.errors import InputError
from trigpoint_tiles.core.cells import FIELDS, Cells
from trigpoint_tiles.core.grid import TILE_PX, Tile
from trigpoint_tiles.core.movement import PlacedSweeps
from trigpoint_tiles.core.part_form import merge_part, part_bytes

ENDING = ".part"
RECORD = "sweeps.npz"


@dataclass(frozen=True, slots=True)
class DriveParts:
    """The parts of one drive on one grid, `<column>_<row>/<piece>_<number>.part` each, in a folder of its own.

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
            shutil.rmtree(self._tile_folder(tile), ignore_errors=True)

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
        names = (path.parent.name.split("_") for path in self.folder.glob(f"*/*{ENDING}"))
        return frozenset(Tile(int(column), int(row)) for column, row in names)

    def cells(self, tile: Tile) -> Cells:
        """A tile's parts merged. Raises InputError for a damaged one."""
        total = np.zeros((TILE_PX, TILE_PX, FIELDS), dtype=np.int64)
        for path in self._tile_folder(tile).glob(f"*{ENDING}"):
            try:
                merge_part(total, path.read_bytes())
            except InputError as error:
                raise InputError(f"{path}: {error}; remove the folder to make it again") from error
        return total

    def piece(self, number: int) -> "PieceParts":
        """Where one piece of the drive puts its parts."""
        return PieceParts(self.folder, number)

    def _tile_folder(self, tile: Tile) -> Path:
        return self.folder / f"{tile.column}_{tile.row}"


class PieceParts:
    """The parts of one piece of a drive: whoever does the piece again puts the same parts in the same places."""

    def __init__(self, folder: Path, number: int) -> None:
        self._folder, self._number = folder, number
        self._counts: Counter[Tile] = Counter()

    @property
    def tiles(self) -> frozenset[Tile]:
        """The tiles that got a part."""
        return frozenset(self._counts)

    def add(self, tile: Tile, cells: Cells) -> None:
        """One more part of a tile, there as a whole or not at all."""
        path = self._folder / f"{tile.column}_{tile.row}" / f"{self._number}_{self._counts[tile]}{ENDING}"
        self._counts[tile] += 1
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_suffix(f".{uuid4().hex}")
        partial.write_bytes(part_bytes(cells))
        partial.replace(path)

"""The cells of the tiles points fall on, within a bound of memory: what is not touched now is handed on as a part."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.events.scanned import PointsScanned
from trigpoint_tiles.core.cells import FIELDS, Cells
from trigpoint_tiles.core.gathering import (
    ASKED_COLUMN,
    ASKED_ROW,
    EAST,
    FAR,
    LEFT_OUT,
    NORTH,
    NOWHERE,
    SOUTH,
    TOO_FAR,
    UNUSABLE,
    USED,
    WEST,
    RangeLimits,
    Target,
    gather,
    no_tally,
)
from trigpoint_tiles.core.grid import TILE_PX, Tile, TileBox, tiles_of
from trigpoint_tiles.core.placement import PlacedSweep

Ints = NDArray[np.int64]

CACHE_LINE = 64  # bytes; half a cell
SLOT_BYTES = TILE_PX * TILE_PX * FIELDS * 8
SLOTS_LEAST = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Gathered:
    """What became of a sweep: points used, not a number, and too near or far; the box (4,) of cells hit: west, north,
    east, south, None where none was."""

    used: int
    unusable: int
    out_of_range: int
    box: tuple[int, int, int, int] | None


class Accumulator:
    """Cells of one drive. A tile's cells may be handed on in several parts; merged they are the tile's."""

    def __init__(
        self, *, memory_bytes: int, hand_on: Callable[[Tile, Cells], None], only: frozenset[Tile] | None = None
    ):
        """`only`: the tiles that are wanted, None for all. Raises InputError for less memory than four tiles take."""
        slots = memory_bytes // SLOT_BYTES
        if slots < SLOTS_LEAST:
            least = SLOTS_LEAST * SLOT_BYTES
            raise InputError(f"{memory_bytes} bytes are too few to gather points in: at least {least}")
        self._hand_on, self._only = hand_on, only
        self._pool = _aligned_pool(slots)
        self._free = list(range(slots))
        self._slots: dict[Tile, int] = {}  # the one that was not used for longest first
        self._number = 0

    def add(self, sweep: PointsScanned, placed: PlacedSweep, box: TileBox, limits: RangeLimits) -> Gathered:
        """A sweep gathered that falls within a box of tiles. Raises InputError where memory cannot hold them all."""
        self._number += 1
        slot = np.array([[self._slot_of(tile) for tile in row] for row in tiles_of(box)], dtype=np.int64)
        target = Target(column=box.column, row=box.row, slot=slot, pool=self._pool, tally=no_tally())
        done, count = 0, len(sweep.intensity)
        while done < count:
            done = gather(sweep, placed, target, number=self._number, limits=limits, begin=done)
            if done < count:
                self._give_cells(target, box)
        return _gathered(target.tally)

    def finish(self) -> None:
        """Everything handed on; no sweep can be added any more."""
        for tile, slot in self._slots.items():
            self._hand_on(tile, self._pool[slot])
        self._slots.clear()

    def _slot_of(self, tile: Tile) -> int:
        if self._only is not None and tile not in self._only:
            return LEFT_OUT
        if tile in self._slots:
            self._slots[tile] = self._slots.pop(tile)  # to the end: the newest used
        return self._slots.get(tile, NOWHERE)

    def _give_cells(self, target: Target, box: TileBox) -> None:
        """Cells for the tile the kernel asked for: empty ones, or those of the tile that was not used for longest."""
        asked = int(target.tally[ASKED_ROW]), int(target.tally[ASKED_COLUMN])
        if not self._free:
            oldest = next((tile for tile in self._slots if not box.holds(tile)), None)
            if oldest is None:
                need, have = box.rows * box.columns, len(self._pool)
                raise InputError(f"a sweep reaches over {need} tiles of {SLOT_BYTES} bytes: memory is for {have}")
            self._release(oldest)
        tile = Tile(box.column + asked[1], box.row + asked[0])
        self._slots[tile] = target.slot[asked] = self._free.pop()

    def _release(self, tile: Tile) -> None:
        slot = self._slots.pop(tile)
        self._hand_on(tile, self._pool[slot])
        self._pool[slot] = 0
        self._free.append(slot)


def _gathered(tally: Ints) -> Gathered:
    west, north, east, south = (int(one) for one in tally[[WEST, NORTH, EAST, SOUTH]])
    return Gathered(
        used=int(tally[USED]),
        unusable=int(tally[UNUSABLE]),
        out_of_range=int(tally[TOO_FAR]),
        box=None if west == FAR else (west, north, east, south),
    )


def _aligned_pool(slots: int) -> Cells:
    """Empty cells (slots, 256, 256, FIELDS), each on two whole cache lines."""
    count = slots * TILE_PX * TILE_PX * FIELDS
    raw = np.zeros(count + CACHE_LINE // 8, dtype=np.int64)
    first = (-raw.ctypes.data % CACHE_LINE) // 8
    return raw[first : first + count].reshape(slots, TILE_PX, TILE_PX, FIELDS)

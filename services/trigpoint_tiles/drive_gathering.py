"""Pieces of drives gathered into parts of tiles, each by one worker."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.scanned import PointsScanned
from trigpoint.geodesy.projection import MapFrame
from trigpoint_tiles.clouds import DriveClouds, read_sweeps
from trigpoint_tiles.core.accumulator import Accumulator
from trigpoint_tiles.core.driven_path import DrivenPath
from trigpoint_tiles.core.gathering import RangeLimits
from trigpoint_tiles.core.grid import RasterGrid, Tile
from trigpoint_tiles.core.movement import NOTHING_HIT
from trigpoint_tiles.core.placement import SweepPlacer, sweep_span_ns
from trigpoint_tiles.hands import OpenLog
from trigpoint_tiles.part_files import DriveParts
from trigpoint_tiles.settings import TilesSettings

Ints = NDArray[np.int64]
SweepDone = Callable[[int], None]


@dataclass(slots=True)
class SweepCounts:
    """What became of sweeps and their points."""

    used: int = 0
    outside_path: int = 0
    kept_from_before: int = 0
    points: int = 0
    points_unusable: int = 0
    points_out_of_range: int = 0

    def add(self, more: "SweepCounts") -> None:
        """Counts those of other sweeps too."""
        for one in fields(self):
            setattr(self, one.name, getattr(self, one.name) + getattr(more, one.name))


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """Sweeps of a drive for one worker: of those to be gathered the ones from `first` on, into the parts in `folder`,
    of the tiles `only`, None for all."""

    clouds: DriveClouds
    number: int
    first: int
    folder: Path
    only: frozenset[Tile] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class GatheredPiece:
    """The boxes (n, 4) of cells that each sweep hit, the counts, and the tiles that got parts."""

    box: Ints
    counts: SweepCounts
    tiles: frozenset[Tile]


@dataclass(frozen=True, slots=True)
class PieceGathering:
    """Gathers pieces of drives on one grid, each by itself; `heard` is told of sweeps as they are done."""

    open_log: OpenLog
    frame: MapFrame
    grid: RasterGrid
    settings: TilesSettings
    heard: SweepDone | None

    def __call__(self, piece: Piece) -> GatheredPiece:
        """The piece's parts written. Raises InputError where memory is too little for a sweep."""
        gatherer = _SweepGatherer(piece, self.frame, self.grid, self.settings)
        box = np.tile(NOTHING_HIT, (len(piece.clouds.sequence), 1))
        with self.open_log() as log:
            for row, stamp_ns, sweep in read_sweeps(log, piece.clouds):
                box[row] = gatherer.box_of(sweep, stamp_ns)
                if self.heard is not None:
                    self.heard(1)
        return GatheredPiece(box=box, counts=gatherer.counts, tiles=gatherer.finished())


class _SweepGatherer:
    """Adds sweeps of a piece to its parts and counts them."""

    def __init__(self, piece: Piece, frame: MapFrame, grid: RasterGrid, settings: TilesSettings) -> None:
        self._parts = DriveParts(piece.folder).piece(piece.number)
        memory_bytes = settings.memory_bytes
        self._accumulator = Accumulator(memory_bytes=memory_bytes, hand_on=self._parts.add, only=piece.only)
        self._limits = RangeLimits(least_m=settings.range_least_m, most_m=settings.range_most_m)
        self._placer = SweepPlacer(frame, grid, reach_m=settings.range_most_m, deskew=settings.deskew)
        self._path: DrivenPath | None = piece.clouds.path
        self.counts = SweepCounts()

    def box_of(self, sweep: PointsScanned, stamp_ns: int) -> Ints:
        """The box (4,) of cells a sweep hit."""
        if self._path is None or not self._path.holds(*sweep_span_ns(sweep, stamp_ns)):
            self.counts.outside_path += 1
            return NOTHING_HIT
        placed, box = self._placer.placed(sweep, stamp_ns, self._path)
        found = self._accumulator.add(sweep, placed, box, self._limits)
        self.counts.add(
            SweepCounts(
                used=1,
                points=found.used,
                points_unusable=found.unusable,
                points_out_of_range=found.out_of_range,
            )
        )
        return NOTHING_HIT if found.box is None else np.array(found.box, dtype=np.int64)

    def finished(self) -> frozenset[Tile]:
        """The tiles that got parts, once everything is handed on."""
        self._accumulator.finish()
        return self._parts.tiles

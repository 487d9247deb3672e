"""What of a drive is to be gathered: all of it, or what moved since; in pieces that workers do side by side."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import ServiceError
from trigpoint.geodesy.projection import MapFrame
from trigpoint_tiles.clouds import DriveClouds
from trigpoint_tiles.core.grid import RasterGrid, Tile
from trigpoint_tiles.core.movement import NOTHING_HIT, PlacedSweeps, changed_tiles, moved_px, tiles_near
from trigpoint_tiles.core.placement import SweepPlacer
from trigpoint_tiles.drive_gathering import GatheredPiece, Piece, SweepCounts
from trigpoint_tiles.part_files import DriveParts
from trigpoint_tiles.settings import TilesSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

PIECE_SWEEPS = 400  # gathered by one worker: what its death costs


class DrivePlan:
    """A drive being brought up to its path: begun, its pieces taken in as they are gathered, finished with the last."""

    def __init__(
        self, parts: DriveParts, clouds: DriveClouds, record: PlacedSweeps, *, only: frozenset[Tile] | None, rows: Ints
    ) -> None:
        """clouds: the sweeps to be gathered, the rows (n,) of `record`, which is what the parts will be of; their
        boxes there are filled in. only: the tiles that change, None for all."""
        self.parts, self._clouds, self._record, self._only, self._rows = parts, clouds, record, only, rows
        self._left = -(-len(rows) // PIECE_SWEEPS)
        self._written = frozenset[Tile]()
        self.counts = SweepCounts(kept_from_before=len(record.sequence) - len(rows))

    @property
    def changed(self) -> frozenset[Tile]:
        """The tiles that changed; of a drive gathered as a whole only once it is finished."""
        return self.parts.tiles() if self._only is None else self._only

    def begun(self) -> Iterator[Piece]:
        """The pieces to gather, after room was made for them."""
        if self._only is not None and not self._only:
            return
        self.parts.begin(self._only)
        if not self._left:
            self.parts.finish(self._record)
        for number, first in enumerate(range(0, len(self._rows), PIECE_SWEEPS)):
            rows = np.arange(first, min(first + PIECE_SWEEPS, len(self._rows)))
            some = self._clouds.selected(rows)
            yield Piece(clouds=some, number=number, first=first, folder=self.parts.folder, only=self._only)

    def take(self, piece: Piece, gathered: GatheredPiece) -> None:
        """One more piece is gathered. Raises ServiceError where its parts are not to be seen from here."""
        self._record.box[self._rows[piece.first : piece.first + len(gathered.box)]] = gathered.box
        self.counts.add(gathered.counts)
        self._written |= gathered.tiles
        self._left -= 1
        if self._left:
            return
        if unseen := self._written - self.parts.tiles():
            told = f"{len(unseen)} of {len(self._written)} tiles that workers wrote are not here"
            raise ServiceError(f"{self.parts.folder}: {told}: all of them need to see this folder")
        self.parts.finish(self._record)


class DrivePlanner:
    """Says what of drives is to be gathered on one grid."""

    def __init__(self, frame: MapFrame, grid: RasterGrid, settings: TilesSettings) -> None:
        self._grid, self._reach_m = grid, settings.range_most_m
        self._placer = SweepPlacer(frame, grid, reach_m=settings.range_most_m)

    def plan(self, clouds: DriveClouds, parts: DriveParts) -> DrivePlan:
        """What brings a drive's parts up to its path. Raises InputError where their record is damaged."""
        placed, before = _placeable(clouds), parts.sweeps()
        plan = self._whole(placed, parts) if before is None else self._moved(placed, parts, before)
        plan.counts.outside_path += len(clouds.sequence) - len(placed.sequence)
        return plan

    def _whole(self, clouds: DriveClouds, parts: DriveParts) -> DrivePlan:
        box = np.tile(NOTHING_HIT, (len(clouds.sequence), 1))
        record = PlacedSweeps(sequence=clouds.sequence, pose=_poses(clouds), box=box)
        return DrivePlan(parts, clouds, record, only=None, rows=np.arange(len(clouds.sequence)))

    def _moved(self, clouds: DriveClouds, parts: DriveParts, before: PlacedSweeps) -> DrivePlan:
        now = self._expected(clouds, before)
        changed = changed_tiles(before, now, self._grid, reach_m=self._reach_m)
        rows = np.flatnonzero(self._may_fall_on(now, before, changed))
        pose = _kept_poses(before, now, self._grid, self._reach_m)
        record = PlacedSweeps(sequence=now.sequence, pose=pose, box=now.box.copy())
        return DrivePlan(parts, clouds.selected(rows), record, only=changed, rows=rows)

    def _expected(self, clouds: DriveClouds, before: PlacedSweeps) -> PlacedSweeps:
        """The sweeps on the path as it is now: with the box of what they hit before, or all within reach."""
        pose, box = _poses(clouds), np.tile(NOTHING_HIT, (len(clouds.sequence), 1))
        _, old, new = np.intersect1d(before.sequence, clouds.sequence, return_indices=True)
        box[new] = before.box[old]
        for row in np.setdiff1d(np.arange(len(clouds.sequence)), new):
            box[row] = self._placer.reached_cells(pose[row, :2])
        return PlacedSweeps(sequence=clouds.sequence, pose=pose, box=box)

    def _may_fall_on(self, now: PlacedSweeps, before: PlacedSweeps, tiles: frozenset[Tile]) -> Flags:
        """Which sweeps may fall on the tiles."""
        _, old, new = np.intersect1d(before.sequence, now.sequence, return_indices=True)
        margin = np.zeros(len(now.sequence), dtype=np.int64)
        by_px = moved_px(before.pose[old], now.pose[new], self._grid, reach_m=self._reach_m)
        margin[new] = np.ceil(by_px).astype(np.int64) + 1
        return np.array(
            [not tiles.isdisjoint(tiles_near(box, margin_px=int(by))) for box, by in zip(now.box, margin, strict=True)],
            dtype=bool,
        )


def _placeable(clouds: DriveClouds) -> DriveClouds:
    """The sweeps the path has a place for."""
    path = clouds.path
    within = [path is not None and path.holds(stamp, stamp) for stamp in clouds.stamp_ns.tolist()]
    return clouds.selected(np.flatnonzero(np.array(within, dtype=bool)))


def _poses(clouds: DriveClouds) -> Floats:
    return np.zeros((0, 3)) if clouds.path is None else clouds.path.poses_at(clouds.stamp_ns)


def _kept_poses(before: PlacedSweeps, now: PlacedSweeps, grid: RasterGrid, reach_m: float) -> Floats:
    """Of each sweep the oldest pose some tile still shows it at: that from before, unless it moved by over a pixel."""
    pose = now.pose.copy()
    _, old, new = np.intersect1d(before.sequence, now.sequence, return_indices=True)
    stays = moved_px(before.pose[old], now.pose[new], grid, reach_m=reach_m) <= 1.0
    pose[new[stays]] = before.pose[old[stays]]
    return pose

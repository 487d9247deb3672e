"""A drive's points gathered into parts of tiles: all of them, or of those that moved since."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.scanned import PointsScanned
from trigpoint.geodesy.projection import MapFrame
from trigpoint.logs.ports import RecallingLog
from trigpoint_tiles.clouds import DriveClouds, read_sweeps
from trigpoint_tiles.core.accumulator import Accumulator
from trigpoint_tiles.core.driven_path import DrivenPath
from trigpoint_tiles.core.gathering import RangeLimits
from trigpoint_tiles.core.grid import RasterGrid, Tile
from trigpoint_tiles.core.movement import NOTHING_HIT, PlacedSweeps, changed_tiles, moved_px, tiles_near
from trigpoint_tiles.core.placement import SweepPlacer, sweep_span_ns
from trigpoint_tiles.part_files import DriveParts
from trigpoint_tiles.settings import TilesSettings

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
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


@dataclass(frozen=True, slots=True, kw_only=True)
class GatheredDrive:
    """A drive's parts, the tiles among them that changed now, and the counts."""

    parts: DriveParts
    changed: frozenset[Tile]
    counts: SweepCounts = field(default_factory=SweepCounts)


class DriveGatherer:
    """Gathers drives on one grid."""

    def __init__(self, log: RecallingLog, frame: MapFrame, grid: RasterGrid, settings: TilesSettings) -> None:
        self._log, self._grid, self._settings = log, grid, settings
        self._limits = RangeLimits(least_m=settings.range_least_m, most_m=settings.range_most_m)
        self._placer = SweepPlacer(frame, grid, reach_m=settings.range_most_m, deskew=settings.deskew)

    def gathered(self, clouds: DriveClouds, parts: DriveParts, *, progress: SweepDone) -> GatheredDrive:
        """The drive's parts brought up to its path. Raises InputError where memory is too little or a part damaged."""
        placed, counts = self._placeable(clouds)
        before = parts.sweeps()
        if before is None:
            return self._all_anew(placed, parts, counts, progress)
        now = self._expected(placed, before)
        changed = changed_tiles(before, now, self._grid, reach_m=self._limits.most_m)
        wanted = self._rows_on(now, before, changed)
        counts.kept_from_before = int((~wanted).sum())
        if changed:
            box, pose = now.box.copy(), _kept_poses(before, now, self._grid, self._limits.most_m)
            parts.begin(changed)
            box[wanted] = self._gather(placed.selected(np.flatnonzero(wanted)), parts, changed, counts, progress)
            parts.finish(PlacedSweeps(sequence=now.sequence, pose=pose, box=box))
        return GatheredDrive(parts=parts, changed=changed, counts=counts)

    def _all_anew(
        self, clouds: DriveClouds, parts: DriveParts, counts: SweepCounts, progress: SweepDone
    ) -> GatheredDrive:
        parts.begin(None)
        box = self._gather(clouds, parts, None, counts, progress)
        parts.finish(PlacedSweeps(sequence=clouds.sequence, pose=_poses(clouds), box=box))
        return GatheredDrive(parts=parts, changed=parts.tiles(), counts=counts)

    def _placeable(self, clouds: DriveClouds) -> tuple[DriveClouds, SweepCounts]:
        """The sweeps the path has a place for."""
        path = clouds.path
        within = [path is not None and path.holds(stamp, stamp) for stamp in clouds.stamp_ns.tolist()]
        rows = np.flatnonzero(np.array(within, dtype=bool))
        return clouds.selected(rows), SweepCounts(outside_path=len(within) - len(rows))

    def _gather(
        self,
        clouds: DriveClouds,
        parts: DriveParts,
        only: frozenset[Tile] | None,
        counts: SweepCounts,
        progress: SweepDone,
    ) -> Ints:
        """The boxes (n, 4) of cells that each sweep hit."""
        box = np.tile(NOTHING_HIT, (len(clouds.sequence), 1))
        accumulator = Accumulator(memory_bytes=self._settings.memory_bytes, hand_on=parts.add, only=only)
        for row, stamp_ns, sweep in read_sweeps(self._log, clouds):
            assert clouds.path is not None  # else no sweep of it was placeable
            found = self._add(accumulator, sweep, stamp_ns, clouds.path, counts)
            if found is not None:
                box[row] = found
            progress(1)
        accumulator.finish()
        return box

    def _add(
        self, accumulator: Accumulator, sweep: PointsScanned, stamp_ns: int, path: DrivenPath, counts: SweepCounts
    ) -> tuple[int, int, int, int] | None:
        if not path.holds(*sweep_span_ns(sweep, stamp_ns)):
            counts.outside_path += 1
            return None
        placed, box = self._placer.placed(sweep, stamp_ns, path)
        found = accumulator.add(sweep, placed, box, self._limits)
        counts.used += 1
        counts.points += found.used
        counts.points_unusable += found.unusable
        counts.points_out_of_range += found.out_of_range
        return found.box

    def _expected(self, clouds: DriveClouds, before: PlacedSweeps) -> PlacedSweeps:
        """The sweeps on the path as it is now: with the box of what they hit before, or all within reach."""
        pose, box = _poses(clouds), np.tile(NOTHING_HIT, (len(clouds.sequence), 1))
        _, old, new = np.intersect1d(before.sequence, clouds.sequence, return_indices=True)
        box[new] = before.box[old]
        for row in np.setdiff1d(np.arange(len(clouds.sequence)), new):
            box[row] = self._placer.reached_cells(pose[row, :2])
        return PlacedSweeps(sequence=clouds.sequence, pose=pose, box=box)

    def _rows_on(self, now: PlacedSweeps, before: PlacedSweeps, tiles: frozenset[Tile]) -> Flags:
        """Which sweeps may fall on the tiles."""
        _, old, new = np.intersect1d(before.sequence, now.sequence, return_indices=True)
        margin = np.zeros(len(now.sequence), dtype=np.int64)
        by_px = moved_px(before.pose[old], now.pose[new], self._grid, reach_m=self._limits.most_m)
        margin[new] = np.ceil(by_px).astype(np.int64) + 1
        return np.array(
            [not tiles.isdisjoint(tiles_near(box, margin_px=int(by))) for box, by in zip(now.box, margin, strict=True)],
            dtype=bool,
        )


def _poses(clouds: DriveClouds) -> NDArray[np.float64]:
    return np.zeros((0, 3)) if clouds.path is None else clouds.path.poses_at(clouds.stamp_ns)


def _kept_poses(before: PlacedSweeps, now: PlacedSweeps, grid: RasterGrid, reach_m: float) -> NDArray[np.float64]:
    """Of each sweep the oldest pose some tile still shows it at: that from before, unless it moved by over a pixel."""
    pose = now.pose.copy()
    _, old, new = np.intersect1d(before.sequence, now.sequence, return_indices=True)
    stays = moved_px(before.pose[old], now.pose[new], grid, reach_m=reach_m) <= 1.0
    pose[new[stays]] = before.pose[old[stays]]
    return pose

"""Drives in pieces: which sweeps are whose, and parts that went elsewhere."""

from pathlib import Path

import numpy as np
import pytest

from scanned_drives.examples import FRAME, START_NS, SWEEP_NS, arc, solved_path
from trigpoint.errors import ServiceError
from trigpoint_tiles.clouds import DriveClouds, DriveName
from trigpoint_tiles.core.driven_path import path_of
from trigpoint_tiles.core.grid import Tile, projected_grid
from trigpoint_tiles.core.movement import NOTHING_HIT
from trigpoint_tiles.drive_gathering import GatheredPiece, Piece, SweepCounts
from trigpoint_tiles.drive_plans import PIECE_SWEEPS, DrivePlan, DrivePlanner
from trigpoint_tiles.part_files import DriveParts
from trigpoint_tiles.settings import TilesSettings

SWEEPS = PIECE_SWEEPS + 10
GRID = projected_grid(FRAME.crs, resolution_m=0.5)


def plan_in(folder: Path) -> DrivePlan:
    """Of a drive that is a little longer than a piece."""
    clouds = DriveClouds(
        name=DriveName("car", "b"),
        sequence=np.arange(SWEEPS),
        stamp_ns=START_NS + SWEEP_NS * np.arange(SWEEPS),
        path=path_of(solved_path("car", arc(0.1 * SWEEPS + 1.0))),
    )
    return DrivePlanner(FRAME, GRID, TilesSettings()).plan(clouds, DriveParts(folder))


def gathered(piece: Piece, *tiles: Tile) -> GatheredPiece:
    """A piece whose every sweep hit nothing, but which says that it wrote parts of tiles."""
    box = np.tile(NOTHING_HIT, (len(piece.clouds.sequence), 1))
    return GatheredPiece(box=box, counts=SweepCounts(used=len(box)), tiles=frozenset(tiles))


def test_pieces_hold_every_sweep_once_and_the_drive_is_whole_with_the_last_of_them(tmp_path: Path) -> None:
    plan = plan_in(tmp_path / "drive")
    first, second = plan.begun()
    assert np.array_equal(np.append(first.clouds.sequence, second.clouds.sequence), np.arange(SWEEPS))
    plan.take(second, gathered(second))
    assert plan.parts.sweeps() is None
    plan.take(first, gathered(first))
    assert plan.parts.sweeps() is not None
    assert plan.counts.used == SWEEPS


def test_parts_that_workers_wrote_to_a_folder_of_their_own_are_missed(tmp_path: Path) -> None:
    plan = plan_in(tmp_path / "drive")
    first, second = plan.begun()
    plan.take(first, gathered(first))
    with pytest.raises(ServiceError, match="1 of 1 tiles that workers wrote are not here"):
        plan.take(second, gathered(second, Tile(3, 4)))
    assert plan.parts.sweeps() is None

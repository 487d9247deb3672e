"""Points onto cells: where they fall, what a cell says, and that no order of gathering matters."""

from dataclasses import replace

import numpy as np
import pytest

from scanned_drives.examples import (
    FRAME,
    SENSOR_M,
    START_NS,
    SWEEP_NS,
    arc,
    painted_ground,
    solved_path,
    sweep_at,
)
from trigpoint.errors import InputError
from trigpoint.events.scanned import PointsScanned
from trigpoint.geodesy.poses import transform_points
from trigpoint_tiles.core.accumulator import SLOT_BYTES, Accumulator
from trigpoint_tiles.core.cells import FIELDS, GROUND_COUNT, GROUND_INTENSITY, INTENSITY_STEPS, Cells
from trigpoint_tiles.core.driven_path import DrivenPath, path_of
from trigpoint_tiles.core.gathering import RangeLimits
from trigpoint_tiles.core.grid import TILE_PX, RasterGrid, Tile, projected_grid, web_mercator_zoom
from trigpoint_tiles.core.part_form import merge_part, part_bytes
from trigpoint_tiles.core.placement import SweepPlacer, exact_pixels

UTM = projected_grid(FRAME.crs, resolution_m=0.2)
PATH = path_of(solved_path("car", arc(6.0)))
LIMITS = RangeLimits(least_m=0.1, most_m=60.0)
MEMORY = 32 * SLOT_BYTES


def sweeps(count: int, *, seed: int = 3) -> list[tuple[int, PointsScanned]]:
    random = np.random.default_rng(seed)
    stamps = [START_NS + SWEEP_NS * number for number in range(count)]
    return [(stamp, sweep_at(PATH, stamp, painted_ground, random)) for stamp in stamps]


def no_cells() -> Cells:
    """A tile nobody saw."""
    return np.zeros((TILE_PX, TILE_PX, FIELDS), dtype=np.int64)


def gathered(
    rows: list[tuple[int, PointsScanned]],
    grid: RasterGrid = UTM,
    *,
    path: DrivenPath = PATH,
    memory: int = MEMORY,
    reach_m: float = 60.0,
) -> dict[Tile, Cells]:
    """The merged cells of every tile."""
    total: dict[Tile, Cells] = {}

    def keep(tile: Tile, cells: Cells) -> None:
        merge_part(total.setdefault(tile, no_cells()), part_bytes(cells))

    accumulator, placer = Accumulator(memory_bytes=memory, hand_on=keep), SweepPlacer(FRAME, grid, reach_m=reach_m)
    for stamp_ns, sweep in rows:
        placed, box = placer.placed(sweep, stamp_ns, path)
        accumulator.add(sweep, placed, box, LIMITS)
    accumulator.finish()
    return total


def expected_counts(stamp_ns: int, sweep: PointsScanned, grid: RasterGrid) -> dict[tuple[int, int], int]:
    """How many points each cell has, one pose and one exact projection a point."""
    pose = PATH.poses_at(stamp_ns + sweep.offset_ns.astype(np.int64))
    base_m = sweep.point_m.astype(np.float64) + SENSOR_M
    cell = np.floor(exact_pixels(transform_points(pose, base_m[:, :2]), FRAME, grid)).astype(int)
    keys, counts = np.unique(cell, axis=0, return_counts=True)
    return {(int(column), int(row)): int(count) for (column, row), count in zip(keys, counts, strict=True)}


def counts_of(tiles: dict[Tile, Cells]) -> dict[tuple[int, int], int]:
    found = {}
    for tile, cells in tiles.items():
        for row, column in np.argwhere(cells[..., GROUND_COUNT]):
            at = (tile.column * TILE_PX + int(column), tile.row * TILE_PX + int(row))
            found[at] = int(cells[row, column, GROUND_COUNT])
    return found


def test_without_deskew_all_points_are_placed_by_the_pose_at_the_sweeps_stamp() -> None:
    ((stamp_ns, sweep),) = sweeps(1)
    skewed, _ = SweepPlacer(FRAME, UTM, reach_m=60.0, deskew=False).placed(sweep, stamp_ns, PATH)
    at_once = replace(sweep, offset_ns=np.zeros_like(sweep.offset_ns))
    still, _ = SweepPlacer(FRAME, UTM, reach_m=60.0).placed(at_once, stamp_ns, PATH)
    assert (skewed.table.to_plane == still.table.to_plane[0]).all()


@pytest.mark.parametrize("grid", [UTM, web_mercator_zoom(19)], ids=["utm", "web"])
def test_points_fall_where_each_ones_own_pose_and_the_exact_projection_put_them(grid: RasterGrid) -> None:
    ((stamp_ns, sweep),) = sweeps(1)
    found, expected = counts_of(gathered([(stamp_ns, sweep)], grid)), expected_counts(stamp_ns, sweep, grid)
    other = sum(abs(found.get(cell, 0) - expected.get(cell, 0)) for cell in found.keys() | expected.keys()) / 2
    assert sum(found.values()) == len(sweep.intensity)
    # Within 0.05 pixels a point falls into a neighbouring cell in 2 x 0.05 of all cases.
    assert other <= 0.1 * len(sweep.intensity)


def test_where_the_projection_bends_too_much_every_point_is_projected_by_itself() -> None:
    grid, ((stamp_ns, sweep),) = web_mercator_zoom(20), sweeps(1)
    found = counts_of(gathered([(stamp_ns, sweep)], grid, reach_m=900.0))
    assert len(SweepPlacer(FRAME, grid, reach_m=900.0).placed(sweep, stamp_ns, PATH)[0].bend_px) == len(sweep.intensity)
    expected = expected_counts(stamp_ns, sweep, grid)
    other = sum(abs(found.get(cell, 0) - expected.get(cell, 0)) for cell in found.keys() | expected.keys()) / 2
    assert other <= 0.001 * len(sweep.intensity)  # what the table's straight milliseconds leave


def test_any_order_and_any_split_of_the_sweeps_gives_the_same_cells() -> None:
    rows = sweeps(8)
    forward, backward = gathered(rows), gathered(rows[::-1])
    split = gathered(rows[:3])
    for tile, cells in gathered(rows[3:]).items():
        merge_part(split.setdefault(tile, no_cells()), part_bytes(cells))
    assert forward.keys() == backward.keys() == split.keys()
    assert all(np.array_equal(forward[tile], backward[tile]) for tile in forward)
    assert all(np.array_equal(forward[tile], split[tile]) for tile in forward)


def test_little_memory_gives_the_same_cells_as_much() -> None:
    far = path_of(solved_path("car", arc(40.0)))
    random = np.random.default_rng(5)
    stamps = [START_NS + 3_000_000_000 * number for number in range(12)]
    rows = [(stamp, sweep_at(far, stamp, painted_ground, random)) for stamp in stamps]
    roomy, tight = gathered(rows, path=far, memory=256 * SLOT_BYTES), gathered(rows, path=far, memory=16 * SLOT_BYTES)
    assert len(roomy) > 16
    assert roomy.keys() == tight.keys()
    assert all(np.array_equal(roomy[tile], tight[tile]) for tile in roomy)


def test_memory_for_less_than_a_sweep_reaches_over_is_refused_with_both_numbers() -> None:
    fine = projected_grid(FRAME.crs, resolution_m=0.02)
    with pytest.raises(InputError, match=r"reaches over \d+ tiles .* memory is for 4"):
        gathered(sweeps(1), fine, memory=4 * SLOT_BYTES)


def test_a_cell_has_the_mean_of_its_points_intensities() -> None:
    ((stamp_ns, sweep),) = sweeps(1)
    even = replace(sweep, intensity=np.full_like(sweep.intensity, 12.5))
    cells = np.concatenate([tile.reshape(-1, FIELDS) for tile in gathered([(stamp_ns, even)]).values()])
    seen = cells[cells[:, GROUND_COUNT] > 0]
    assert np.array_equal(seen[:, GROUND_INTENSITY], seen[:, GROUND_COUNT] * int(12.5 * INTENSITY_STEPS))


def test_points_that_are_no_numbers_are_counted_and_cost_no_other_point() -> None:
    ((stamp_ns, sweep),) = sweeps(1)
    broken = sweep.point_m.copy()
    broken[::10] = np.nan
    accumulator = Accumulator(memory_bytes=MEMORY, hand_on=lambda tile, cells: None)
    placed, box = SweepPlacer(FRAME, UTM, reach_m=60.0).placed(sweep, stamp_ns, PATH)
    found = accumulator.add(replace(sweep, point_m=broken), placed, box, LIMITS)
    assert (found.unusable, found.used) == (400, 3600)


def test_a_sensor_that_is_said_to_be_far_from_its_vehicle_hits_nothing_and_its_points_are_counted() -> None:
    ((stamp_ns, sweep),) = sweeps(1)
    astray = replace(sweep, sensor_position_m=np.array([500.0, 0.0, 1.9]))
    accumulator = Accumulator(memory_bytes=MEMORY, hand_on=lambda tile, cells: None)
    placed, box = SweepPlacer(FRAME, UTM, reach_m=60.0).placed(astray, stamp_ns, PATH)
    found = accumulator.add(astray, placed, box, LIMITS)
    assert (found.used, found.out_of_range, found.box) == (0, 4000, None)


def test_an_empty_sweep_hits_nothing() -> None:
    ((stamp_ns, sweep),) = sweeps(1)
    none = replace(
        sweep,
        point_m=np.zeros((0, 3), dtype=np.float32),
        intensity=np.zeros(0, dtype=np.float32),
        offset_ns=np.zeros(0, dtype=np.int32),
        ring=np.zeros(0, dtype=np.uint16),
    )
    assert gathered([(stamp_ns, none)]) == {}


def test_a_part_is_read_as_it_was_written_and_a_damaged_one_is_refused() -> None:
    cells = next(iter(gathered(sweeps(2)).values()))
    content, found = part_bytes(cells), no_cells()
    merge_part(found, content)
    assert np.array_equal(found, cells)
    with pytest.raises(InputError, match="damaged"):
        merge_part(no_cells(), content[:-20] + bytes(20))


def test_a_path_between_its_poses_is_an_arc() -> None:
    coarse = path_of(solved_path("car", arc(6.0)))
    sparse = DrivenPath(stamp_ns=coarse.stamp_ns[::10], pose=coarse.pose[::10], covariance=coarse.covariance[::10])
    at_ns = coarse.stamp_ns[:60]
    # A second of 10 m/s turns by 0.1 rad: the chord would be 12 cm off.
    assert np.allclose(sparse.poses_at(at_ns), coarse.pose[:60], atol=1e-6)

"""Which tiles were observed when: by hand, and from a log."""

from collections.abc import Sequence

import numpy as np
import pytest

from landmark_maps.examples import (
    SECOND_NS,
    START_NS,
    append_mapped,
    closing,
    frame,
    pin_frame,
    solved_trajectory,
)
from trigpoint.errors import InputError
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import LandmarkDetection, LandmarksDetected
from trigpoint.geodesy.positions import MapPosition, Wgs84Position
from trigpoint.geodesy.projection import wgs84_from_map
from trigpoint.geodesy.web_tiles import tile_at, tile_coordinates, tile_edges_deg, tile_size_m
from trigpoint.landmarks.asked import CoverageQuestion
from trigpoint.landmarks.queries import DegreeBox, TimeSpan
from trigpoint.logs.memory_log import MemoryLog
from trigpoint_landmarks.answering.observed import ObservedTiles
from trigpoint_landmarks.core.coverage import (
    COVERAGE_ZOOM,
    PAUSE_NS,
    SweepPlaces,
    passes_over_tiles,
    places_on_path,
)

HERE = wgs84_from_map(MapPosition(0.0, 0.0), frame())
HERE_TILE = tile_at(HERE, COVERAGE_ZOOM)


def seen_at(*stamps_ns: int, range_m: float = 30.0) -> SweepPlaces:
    """Sweeps from one place."""
    count = len(stamps_ns)
    return SweepPlaces(
        stamp_ns=np.array(stamps_ns, dtype=np.int64),
        lat_deg=np.full(count, HERE.lat_deg),
        lon_deg=np.full(count, HERE.lon_deg),
        range_m=range_m,
    )


def test_a_tile_is_observed_if_its_middle_is_within_range() -> None:
    passes = passes_over_tiles(seen_at(START_NS, range_m=100.0))
    (at_x,), (at_y,) = tile_coordinates(np.array([HERE.lat_deg]), np.array([HERE.lon_deg]), COVERAGE_ZOOM)
    (size_m,) = tile_size_m(np.array([HERE.lat_deg]), COVERAGE_ZOOM)
    columns, rows = np.meshgrid(np.arange(-9, 10) + HERE_TILE.column, np.arange(-9, 10) + HERE_TILE.row)
    within = np.hypot(columns + 0.5 - at_x, rows + 0.5 - at_y) * size_m <= 100.0
    expected = set(zip(columns[within].tolist(), rows[within].tolist(), strict=True))
    assert {(column, row) for column, row, *_ in passes.tolist()} == expected != set()


def test_a_drive_that_never_detected_anything_observed_nothing() -> None:
    assert len(passes_over_tiles(seen_at(START_NS, range_m=0.0))) == 0


def test_sweeps_without_a_longer_pause_are_one_pass() -> None:
    stamps_ns = [START_NS, START_NS + PAUSE_NS, START_NS + 2 * PAUSE_NS + 1]
    passes = passes_over_tiles(seen_at(*stamps_ns))
    own = [row[2:] for row in passes.tolist() if tuple(row[:2]) == (HERE_TILE.column, HERE_TILE.row)]
    assert own == [[stamps_ns[0], stamps_ns[1], 2], [stamps_ns[2], stamps_ns[2], 1]]


def test_many_sweeps_are_worked_out_as_if_at_once() -> None:
    stamps_ns = [START_NS + number for number in range(50_000)]
    passes = passes_over_tiles(seen_at(*stamps_ns))
    assert {tuple(row[2:]) for row in passes.tolist()} == {(stamps_ns[0], stamps_ns[-1], 50_000)}


def test_sweeps_are_placed_between_the_poses_of_a_path_and_not_beyond_it() -> None:
    stamp_ns, point_m = places_on_path(
        np.array([0, 10, 20]), np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 20.0]]), np.array([25, 15, 5, -1])
    )
    assert stamp_ns.tolist() == [5, 15]
    assert point_m == pytest.approx(np.array([[5.0, 0.0], [10.0, 10.0]]))


def test_a_tiles_edges_hold_what_lies_in_it() -> None:
    west, south, east, north = tile_edges_deg(HERE_TILE)
    assert west <= HERE.lon_deg < east
    assert south < HERE.lat_deg <= north
    middle = Wgs84Position((south + north) / 2.0, (west + east) / 2.0)
    assert tile_at(middle, COVERAGE_ZOOM) == HERE_TILE


def append_sweeps(log: MemoryLog, stamps_ns: Sequence[int], *, range_m: float = 30.0, boot_id: str = "boot-1") -> None:
    """Sweeps of veh-a, one detection in the first and none in the others."""
    one = LandmarkDetection(range_m=range_m, bearing_rad=0.0, kind="pole", signature="", diameter_m=0.2)
    first = log.next_number("veh-veh-a")
    log.append(
        "veh-veh-a",
        [
            Envelope(
                EventIdentity("veh-a", boot_id, first + number),
                stamp_ns,
                LandmarksDetected(detections=(one,) if number == 0 else ()),
            )
            for number, stamp_ns in enumerate(stamps_ns)
        ],
    )


@pytest.fixture
def driven() -> MemoryLog:
    """A drive of 20 m east in two seconds, with five sweeps; one more came after its path ends."""
    log = MemoryLog()
    pin_frame(log)
    append_sweeps(log, [START_NS + number * SECOND_NS // 2 for number in (0, 1, 2, 3, 4, 9)], range_m=60.0)
    append_mapped(log, [solved_trajectory(), closing(1, 0)])
    return log


def observed(log: MemoryLog) -> ObservedTiles:
    return ObservedTiles(log, tiles_most=1_000)


def test_a_drives_coverage_is_where_its_sweeps_were_on_its_path(driven: MemoryLog) -> None:
    answer = observed(driven).answer(CoverageQuestion())
    own = [one for one in answer.tiles if one.tile == HERE_TILE]
    assert answer.map.map_version == 1
    assert [(one.vehicle, one.first_ns, one.last_ns, one.sweep_count) for one in own] == [
        ("veh-a", START_NS, START_NS + 2 * SECOND_NS, 5)
    ]


def test_coverage_is_asked_for_by_area_time_and_vehicle(driven: MemoryLog) -> None:
    tiles = observed(driven)
    west, south, east, north = tile_edges_deg(HERE_TILE)
    inside = DegreeBox(
        lon_min_deg=west + 1e-7, lat_min_deg=south + 1e-7, lon_max_deg=east - 1e-7, lat_max_deg=north - 1e-7
    )
    assert {one.tile for one in tiles.answer(CoverageQuestion(bbox=inside)).tiles} == {HERE_TILE}
    assert tiles.answer(CoverageQuestion(vehicle="veh-b")).tiles == ()
    later = TimeSpan(first_ns=START_NS + 3 * SECOND_NS, last_ns=START_NS + 9 * SECOND_NS)
    assert tiles.answer(CoverageQuestion(seen=later)).tiles == ()


def test_coverage_follows_the_log(driven: MemoryLog) -> None:
    tiles = observed(driven)
    before = tiles.answer(CoverageQuestion())
    append_mapped(driven, [solved_trajectory(map_version=2, pose_count=6), closing(2, 0)])
    after = tiles.answer(CoverageQuestion())
    assert (before.map.map_version, after.map.map_version) == (1, 2)
    assert max(one.last_ns for one in after.tiles) == START_NS + 9 * SECOND_NS // 2


def test_a_drive_that_is_not_in_the_newest_whole_version_observed_nothing(driven: MemoryLog) -> None:
    append_mapped(driven, [closing(2, 0)])
    assert observed(driven).answer(CoverageQuestion()).tiles == ()


def test_more_tiles_than_are_answered_at_once_are_refused(driven: MemoryLog) -> None:
    with pytest.raises(InputError, match="at most 1 are answered at once"):
        ObservedTiles(driven, tiles_most=1).answer(CoverageQuestion())


def test_an_empty_log_has_no_coverage() -> None:
    answer = observed(MemoryLog()).answer(CoverageQuestion())
    assert (answer.map.map_version, answer.tiles) == (0, ())

"""What the simulated lidar promises: points on the surfaces that are there, from the pose of their own time."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from trigpoint.events.observed import LandmarksDetected
from trigpoint.events.scanned import PointsScanned
from trigpoint_vehicle.core.lidar.casting import uniform
from trigpoint_vehicle.core.lidar.scanned_campus import ScannedCampus
from trigpoint_vehicle.core.lidar.solids import BOX, CROWN, CYLINDER
from trigpoint_vehicle.core.scene.ground import ground_materials, surface_heights_m
from trigpoint_vehicle.core.scene.materials import Material
from vehicle_lidar.worlds import EXACT, Seen, scanned, seen_in

Floats = NDArray[np.float64]

SWEEP = 150  # at the middle of the drive, at speed
FLOAT32_M = 1e-5  # of a range of 100 m


@pytest.fixture(scope="module")
def exact() -> ScannedCampus:
    return scanned()


@pytest.fixture(scope="module")
def seen(exact: ScannedCampus) -> Seen:
    return seen_in(exact.scans[0], SWEEP)


def of_solids(campus: ScannedCampus, seen: Seen, shape: int, material: Material) -> NDArray[np.bool_]:
    """Which points are of solids that stand still, of a shape and a material."""
    solids = campus.scans[0].solids.solids
    standing = (solids.shape == shape) & (solids.mover < 0) & (solids.material == int(material))
    found: NDArray[np.bool_] = (seen.solid >= 0) & standing[seen.solid]
    return found


def distance_to_axis_m(campus: ScannedCampus, seen: Seen, which: NDArray[np.bool_]) -> Floats:
    centre_m = campus.scans[0].solids.solids.centre[seen.solid[which], :2]
    away: Floats = np.hypot(*(seen.point_m[which, :2] - centre_m).T)
    return away


def local_m(campus: ScannedCampus, points_m: Floats, solid: NDArray[np.int32]) -> Floats:
    """Points (n, 3) in the axes of the boxes they are of."""
    solids = campus.scans[0].solids.solids
    off_m, ahead = points_m - solids.centre[solid], solids.facing[solid]
    along = (off_m[:, :2] * ahead).sum(axis=1)
    across = off_m[:, 1] * ahead[:, 0] - off_m[:, 0] * ahead[:, 1]
    return np.column_stack([along, across, off_m[:, 2]])


def test_points_of_poles_and_trunks_are_on_their_surface(exact: ScannedCampus, seen: Seen) -> None:
    which = of_solids(exact, seen, CYLINDER, Material.POLE) | of_solids(exact, seen, CYLINDER, Material.BARK)
    radius_m = exact.scans[0].solids.solids.size[seen.solid[which], 0]
    off_m = distance_to_axis_m(exact, seen, which) - radius_m
    assert which.sum() > 50
    assert off_m.max() < FLOAT32_M
    # inside the rim only where a ray comes down on a top
    assert (np.abs(off_m) < FLOAT32_M).mean() > 0.9


def test_points_of_walls_and_cars_are_on_a_face_and_never_inside(exact: ScannedCampus, seen: Seen) -> None:
    which = of_solids(exact, seen, BOX, Material.WALL) | of_solids(exact, seen, BOX, Material.CAR)
    outside_m = np.abs(local_m(exact, seen.point_m[which], seen.solid[which]))
    size_m = exact.scans[0].solids.solids.size[seen.solid[which]]
    off_m = np.max(np.column_stack([outside_m[:, :2] - size_m[:, :2], outside_m[:, 2] - size_m[:, 2]]), axis=1)
    assert which.sum() > 500
    assert np.abs(off_m).max() < 5 * FLOAT32_M


def test_points_of_crowns_are_inside_them_at_different_depths(exact: ScannedCampus) -> None:
    seen = seen_in(exact.scans[0], SWEEP)
    which = of_solids(exact, seen, CROWN, Material.LEAF)
    solids = exact.scans[0].solids.solids
    centre = solids.centre[seen.solid[which]] + solids.size[seen.solid[which]] * (0.0, 0.0, 0.5)
    half = solids.size[seen.solid[which]] * (1.0, 1.0, 0.5)
    share = np.linalg.norm((seen.point_m[which] - centre) / half, axis=1)
    assert share.max() < 1.0 + 1e-4  # float32 over a crown's radius
    assert share.min() < 0.7


def test_points_of_the_ground_are_on_carriageway_verge_or_kerb(exact: ScannedCampus, seen: Seen) -> None:
    ground = seen.solid < 0
    kerb = seen.material[ground] == Material.KERB
    point_m = seen.point_m[ground][~kerb]
    off_m = point_m[:, 2] - surface_heights_m(exact.scene.ground, point_m[:, :2])
    assert len(point_m) > 3000
    # the search along a ray ends within 0.1 mm; on a ramp its step is that of a level kerb
    assert np.percentile(np.abs(off_m), 99) < 1e-3


def test_every_point_of_the_ground_says_what_is_painted_there(exact: ScannedCampus, seen: Seen) -> None:
    flat = (seen.solid < 0) & (seen.material != Material.KERB)
    said = seen.material[flat]
    true = ground_materials(exact.scene.ground, seen.point_m[flat, :2])
    assert {Material.ASPHALT, Material.PAINT, Material.GRASS} <= set(said.tolist())
    assert (said == true).mean() > 0.999  # float32 at the edge of a marking


def way_through_m(begin_m: Floats, end_m: Floats, half_m: Floats, height_m: float) -> Floats:
    """How long the ways (n,) between two places (n, 3) in a box's axes go through it."""
    low, high = np.array([-half_m[0], -half_m[1], 0.0]), np.array([half_m[0], half_m[1], height_m])
    span_m = end_m - begin_m
    first, second = (low - begin_m) / span_m, (high - begin_m) / span_m
    enter = np.maximum(np.minimum(first, second).max(axis=1), 0.0)
    leave = np.minimum(np.maximum(first, second).min(axis=1), 1.0)
    through: Floats = np.maximum(leave - enter, 0.0) * np.linalg.norm(span_m, axis=1)
    return through


def test_no_ray_passes_through_a_wall(exact: ScannedCampus, seen: Seen) -> None:
    solids, longest_m = exact.scans[0].solids.solids, 0.0
    for wall in np.flatnonzero(solids.material == int(Material.WALL)):
        number = np.full(len(seen.point_m), wall, dtype=np.int32)
        begin_m, end_m = local_m(exact, seen.sensor_m, number), local_m(exact, seen.point_m, number)
        through_m = way_through_m(begin_m, end_m, solids.size[wall, :2], float(solids.size[wall, 2]))
        longest_m = max(longest_m, float(through_m.max()))
    # float32 of the range, longer inside where a wall is met flat
    assert longest_m < 1e-3


def test_ranges_err_by_their_noise(exact: ScannedCampus) -> None:
    noisy_sensor = replace(EXACT, range_sigma_m=0.025)
    noisy = replace(exact.scans[0], settings=noisy_sensor).taken(SWEEP, SWEEP + 1).range_m[0]
    true = exact.scans[0].taken(SWEEP, SWEEP + 1).range_m[0]
    error_m = (noisy - true)[np.isfinite(noisy) & np.isfinite(true)]
    assert error_m.std() == pytest.approx(0.025, rel=0.05)  # m, of over 10,000 draws
    assert abs(error_m.mean()) < 0.001


def test_some_of_what_comes_back_is_dropped(exact: ScannedCampus) -> None:
    lossy = replace(EXACT, dropout=0.2)
    there = np.isfinite(exact.scans[0].taken(SWEEP, SWEEP + 1).range_m[0])
    left = np.isfinite(replace(exact.scans[0], settings=lossy).taken(SWEEP, SWEEP + 1).range_m[0])
    assert left.sum() / there.sum() == pytest.approx(0.8, abs=0.02)  # 5 sigma of over 10,000 draws
    assert not (left & ~there).any()


def test_dark_ground_is_seen_less_far_than_walls(seen: Seen) -> None:
    range_m = np.linalg.norm(seen.point_m - seen.sensor_m, axis=1)
    assert range_m[seen.material == Material.ASPHALT].max() < 40.0
    assert 45.0 < range_m[seen.material == Material.WALL].max() < 100.0


def off_poles_m(exact: ScannedCampus, *, deskewed: bool) -> Floats:
    """How far the points of poles are from their surface, in sweeps that pass by them."""
    sweeps = [seen_in(exact.scans[0], one, deskewed=deskewed) for one in range(SWEEP - 60, SWEEP + 60, 6)]
    radius_m = exact.scans[0].solids.solids.size[:, 0]
    off_m = list[Floats]()
    for seen in sweeps:
        which = of_solids(exact, seen, CYLINDER, Material.POLE)
        off_m.append(distance_to_axis_m(exact, seen, which) - radius_m[seen.solid[which]])
    return np.concatenate(off_m)


def test_poles_are_smeared_by_the_drive_and_sharp_by_the_true_poses(exact: ScannedCampus) -> None:
    sharp_m, smeared_m = (off_poles_m(exact, deskewed=how) for how in (True, False))
    assert len(sharp_m) > 500
    assert np.median(np.abs(sharp_m)) < FLOAT32_M
    assert np.percentile(np.abs(smeared_m), 90) > 0.125  # m: what 5 m/s go in a quarter of a sweep


def test_what_moves_is_elsewhere_in_the_next_sweep(exact: ScannedCampus) -> None:
    session = exact.scans[0].session
    before, after = session.movers[0].at(10.0)[0], session.movers[0].at(10.1)[0]
    gone_m = np.hypot(*(after - before).T)
    assert np.median(gone_m) == pytest.approx(np.median(session.movers[0].speed_mps) * 0.1, rel=0.2)


def test_cars_parked_in_one_session_are_gone_in_another() -> None:
    first, second = (drive.session.parked for drive in scanned(vehicles=2).scans)
    assert (first & ~second).sum() > 10
    assert (second & ~first).sum() > 10


def test_the_same_seed_gives_the_same_points_in_any_order(exact: ScannedCampus) -> None:
    drive = exact.scans[0]
    together, alone = drive.taken(SWEEP, SWEEP + 2), drive.taken(SWEEP + 1, SWEEP + 2)
    assert np.array_equal(together.range_m[1], alone.range_m[0], equal_nan=True)
    assert np.array_equal(together.intensity[1], alone.intensity[0])


def test_chance_is_even_and_depends_on_seed_and_number_alone() -> None:
    drawn = np.array([uniform(np.uint64(7), number) for number in range(4000)])
    assert uniform(np.uint64(7), 11) == drawn[11]
    assert uniform(np.uint64(8), 11) != drawn[11]
    assert np.histogram(drawn, bins=10, range=(0.0, 1.0))[0] == pytest.approx(400, abs=100)  # 5 sigma


def test_objects_of_the_truth_are_where_they_are_hit(exact: ScannedCampus, seen: Seen) -> None:
    names, solids = exact.scans[0].solids.name, exact.scans[0].solids.solids
    known = {one.name: one for one in exact.objects}
    hit = {names[solid] for solid in set(seen.solid[seen.solid >= 0].tolist()) if solids.shape[solid] == CYLINDER}
    uprights = [known[name] for name in hit if name in known]
    number = [names.index(one.name) for one in uprights]
    assert len(uprights) > 5
    assert [one.radius_m for one in uprights] == pytest.approx(solids.size[number, 0].tolist())
    assert {one.kind for one in uprights} >= {"pole", "trunk"}


def test_four_corners_of_every_building_are_known(exact: ScannedCampus) -> None:
    corners = [one.name for one in exact.objects if one.kind == "corner"]
    assert len(corners) == len(set(corners)) == 4 * len(exact.scene.buildings.name)


def test_rows_have_points_ten_times_a_second_between_the_others(exact: ScannedCampus) -> None:
    rows = exact.recordings[0].rows
    stamps = np.array([row.stamp_ns for row in list(rows[:400])])
    scans = [row for row in rows[:400] if isinstance(row.event, PointsScanned)]
    assert [row.identity.sequence for row in rows[:400]] == list(range(400))
    assert np.all(np.diff(stamps) >= 0)
    assert np.diff([row.stamp_ns for row in scans]) == pytest.approx(1e8)
    assert rows[0].identity.boot_id != exact.campus.recordings[0].rows[0].identity.boot_id
    assert any(isinstance(row.event, LandmarksDetected) for row in rows[:400])


def test_a_sweep_says_its_points_in_the_order_they_were_measured_in(exact: ScannedCampus) -> None:
    (event,) = exact.scans[0].events(SWEEP, SWEEP + 1)
    assert np.all(np.diff(event.offset_ns) >= 0)
    assert 0 <= event.offset_ns[0] < event.offset_ns[-1] < 100_000_000
    elevation = np.arctan2(event.point_m[:, 2], np.hypot(event.point_m[:, 0], event.point_m[:, 1]))
    assert np.degrees(elevation) == pytest.approx(2.0 * event.ring - 15.0, abs=1e-3)  # deg: float32
    assert np.linalg.norm(event.sensor_orientation) == pytest.approx(1.0)

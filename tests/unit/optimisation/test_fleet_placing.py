"""Every drive that can be placed is placed; the others are left out, each with its reason."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from solved_worlds.examples import FRAME, SENSOR_M, START_NS, STEP_S, Lap, World, world
from trigpoint.errors import AlignmentRefused
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.drives import Drive, FixSeries
from trigpoint.geodesy.poses import transform_points
from trigpoint_optimisation.core.stages import Solved, solve_fleet
from trigpoint_optimisation.core.trajectory import poses_at
from trigpoint_optimisation.settings import Method, OdometrySettings, SolveSettings

Floats = NDArray[np.float64]

CAR, VAN = Lap(duration_s=40.0), Lap(vehicle="van", begin_rad=1.0, seed=2, duration_s=40.0)
AFAR = Lap(vehicle="van", begin_rad=0.4 + np.pi, seed=2, duration_s=15.0)


def solved(drives: tuple[Drive, ...], anchors: tuple[AnchorLabelled, ...] = (), method: Method = "loose") -> Solved:
    settings = SolveSettings(method=method, odometry=OdometrySettings(keyframe_m=4.0))  # coarse: half the time
    return solve_fleet(drives, anchors, FRAME, settings)


def signed(found: World, drive: Drive, pose: Floats) -> Drive:
    """The drive with every detection's pole named."""
    seen = drive.detections
    at = pose[np.round((seen.stamp_ns - START_NS) * 1e-9 / STEP_S).astype(np.int64)]
    ray = seen.range_m[:, None] * np.column_stack([np.cos(seen.bearing_rad), np.sin(seen.bearing_rad)])
    point = transform_points(at, SENSOR_M + ray)
    nearest = np.hypot(*(point[:, None] - found.pole_m[None]).transpose(2, 0, 1)).argmin(axis=1)
    return replace(drive, detections=replace(seen, signature=tuple(f"pole-{pole}" for pole in nearest)))


def all_signed(found: World) -> World:
    drives = tuple(signed(found, drive, pose) for drive, pose in zip(found.drives, found.poses, strict=True))
    anchors = tuple(replace(anchor, signature=f"pole-{row}") for row, anchor in enumerate(found.anchors))
    return replace(found, drives=drives, anchors=anchors)


def without_fixes(drive: Drive) -> Drive:
    nothing, none = np.zeros(0), np.zeros(0, dtype=np.int64)
    return replace(
        drive, fixes=FixSeries(stamp_ns=none, lat_deg=nothing, lon_deg=nothing, sigma_m=nothing, sequence=none)
    )


def without_wheels(drive: Drive) -> Drive:
    wheels = drive.wheels
    return replace(
        drive,
        wheels=replace(
            wheels,
            stamp_ns=wheels.stamp_ns[:0],
            speed_mps=wheels.speed_mps[:0],
            steering_rad=wheels.steering_rad[:0],
            yaw_rate_radps=wheels.yaw_rate_radps[:0],
        ),
    )


def standing(drive: Drive) -> Drive:
    fixes, wheels = drive.fixes, drive.wheels
    return replace(
        drive,
        wheels=replace(wheels, speed_mps=np.zeros(len(wheels.stamp_ns))),
        imu=replace(drive.imu, yaw_rate_radps=np.zeros(len(drive.imu.stamp_ns))),
        fixes=replace(fixes, lat_deg=np.full_like(fixes.lat_deg, fixes.lat_deg[0])),
    )


def path_error_m(found: Solved, vehicle: str, pose: Floats) -> float:
    """Mean distance of a vehicle's solved path from its true one, every two seconds."""
    index = [each.drive.vehicle for each in found.fleet.prepared].index(vehicle)
    stamp_ns = START_NS + np.round(np.arange(0, len(pose), 40) * STEP_S * 1e9).astype(np.int64)
    solved_pose = poses_at(found.fleet.prepared[index], found.state.drives[index].pose, stamp_ns)
    return float(np.hypot(*(solved_pose[:, :2] - pose[::40, :2]).T).mean())


@pytest.fixture(scope="module")
def two() -> World:
    return all_signed(world(CAR, VAN))


def test_a_drive_without_fixes_is_placed_beside_one_with_fixes(two: World) -> None:
    found = solved((two.drives[0], without_fixes(two.drives[1])))
    assert found.left_out == ()
    assert path_error_m(found, "van", two.poses[1]) < path_error_m(found, "car", two.poses[0]) + 0.5  # m


def test_a_drive_without_fixes_is_placed_by_anchors_of_known_identity(two: World) -> None:
    found = solved((without_fixes(two.drives[0]), without_fixes(two.drives[1])), two.anchors, "anchored")
    assert path_error_m(found, "car", two.poses[0]) < 0.5  # m: images are off by 0.35
    assert path_error_m(found, "van", two.poses[1]) < 0.5


def test_drives_without_fixes_and_anchors_are_refused_with_the_reason(two: World) -> None:
    with pytest.raises(AlignmentRefused, match=r"vehicle car, drive boot: 0 fixes .* landmarks of known identity"):
        solved((without_fixes(two.drives[0]),))


def test_a_drive_without_fixes_among_unknown_landmarks_is_left_out(two: World) -> None:
    plain = world(CAR, VAN)
    found = solved((plain.drives[0], without_fixes(plain.drives[1])))
    assert [each.drive.vehicle for each in found.fleet.prepared] == ["car"]
    assert [(one.vehicle, one.boot_id) for one in found.left_out] == [("van", "boot")]


def test_a_drive_with_fixes_only_is_left_out(two: World) -> None:
    found = solved((without_wheels(two.drives[0]), two.drives[1]))
    assert [str(one) for one in found.left_out] == [
        "vehicle car, drive boot: 0 wheel measurements: without them its path is unknown"
    ]
    assert path_error_m(found, "van", two.poses[1]) < 4.0  # m: fixes are off by 1.5 for minutes


def test_a_drive_that_never_moves_is_left_out() -> None:
    plain = world(CAR, replace(VAN, duration_s=20.0))
    found = solved((plain.drives[0], standing(plain.drives[1])))
    assert [one.vehicle for one in found.left_out] == ["van"]


def test_a_drive_that_never_moves_alone_is_refused() -> None:
    with pytest.raises(AlignmentRefused, match="vehicle car"):
        solved((standing(world(replace(CAR, duration_s=20.0)).drives[0]),))


def test_two_drives_that_never_meet_are_both_placed() -> None:
    apart = world(replace(CAR, duration_s=15.0), AFAR)
    found = solved(apart.drives)
    assert found.left_out == ()
    assert path_error_m(found, "car", apart.poses[0]) < 4.0  # m: fixes are off by 1.5 for minutes
    assert path_error_m(found, "van", apart.poses[1]) < 4.0


def test_signatures_decide_which_landmark_a_detection_is_of(two: World) -> None:
    found = solved(two.drives)
    names = {name for drive in two.drives for name in drive.detections.signature}
    assert found.association.landmark_count == len(names)


def test_a_rigid_map_holds_a_drive_without_fixes_by_common_landmarks(two: World) -> None:
    found = solved((two.drives[0], without_fixes(two.drives[1])), method="rigid")
    assert path_error_m(found, "van", two.poses[1]) < path_error_m(found, "car", two.poses[0]) + 0.5  # m


def test_a_straight_drive_is_refused_a_rigid_place_and_given_a_loose_one() -> None:
    straight = world(replace(CAR, begin_rad=np.pi / 2 - 0.15, duration_s=4.0))
    with pytest.raises(AlignmentRefused, match="car: nearly"):
        solved(straight.drives, method="rigid")
    assert path_error_m(solved(straight.drives), "car", straight.poses[0]) < 4.0  # m: fixes are off by 1.5


def test_a_rigid_map_holds_a_camera_by_what_it_sees(two: World) -> None:
    # As a camera the van has no averaged sightings: its single ones alone tie it to the car's landmarks.
    van = two.drives[1]
    camera = replace(without_fixes(van), described=replace(van.described, landmark_sensor_model="camera"))
    found = solved((two.drives[0], camera), method="rigid")
    assert set(found.sightings.drive.tolist()) == {0}
    assert path_error_m(found, "van", two.poses[1]) < path_error_m(found, "car", two.poses[0]) + 1.0  # m

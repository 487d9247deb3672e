"""Poles and corners that perception finds from points alone, and those it should have found."""

from collections import Counter
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trigpoint.events.drives import drives_of
from trigpoint.events.perceived import LandmarksPerceived, SweepPerceived
from trigpoint_perception.core.following import NumberedSweep, SweepFollower
from trigpoint_perception.core.motion_prior import wheel_path
from trigpoint_perception.core.perceiving import CORNER, POLE
from trigpoint_perception.settings import PerceptionSettings
from trigpoint_vehicle.core.campus import simulate_campus
from trigpoint_vehicle.core.campus_settings import CampusSettings, RouteSettings, with_plan
from trigpoint_vehicle.core.lidar.scanned_campus import ScannedCampus, scanned_campus
from trigpoint_vehicle.core.lidar.scans import SWEEPS_AT_ONCE, DriveScans
from trigpoint_vehicle.core.lidar_settings import CarriedLidar
from trigpoint_vehicle.core.scene.world import Scene
from vehicle_lidar.worlds import Seen, seen_in

Floats = NDArray[np.float64]

NEAR_M = 0.3  # of the truth: found
SEEN_POINTS, SEEN_SWEEPS = 20, 3  # what is to be found was hit by so many points in so many sweeps
WALL_POINTS, WALL_REACH_M, WALL_OFF_M = 10, 2.0, 0.1  # of a corner, on each of its two walls: so many near it


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """Of one kind: how many things were found, how many of them stand there, how many should have been found, and how
    many of those were."""

    found: int
    true: int
    seen: int
    recalled: int

    @property
    def precision(self) -> float:
        """The share of what was found that stands there."""
        return self.true / self.found if self.found else float("nan")

    @property
    def recall(self) -> float:
        """The share of what should have been found that was."""
        return self.recalled / self.seen if self.seen else float("nan")


@dataclass(frozen=True, slots=True, kw_only=True)
class Driven:
    """A straight street driven once: `told` of each sweep, and where the base truly was (x, y in m over the ground from
    the campus's corner, heading in rad)."""

    scanned: ScannedCampus
    told: list[tuple[LandmarksPerceived, Floats]]


@cache
def driven_along(*, length_m: float, seed: int) -> Driven:
    """A straight street of a campus, perceived from points alone."""
    plan = CampusSettings(vehicles=1, route=RouteSettings(straight_length_m=length_m))
    settings = with_plan(plan, "straight")
    scanned = scanned_campus(simulate_campus(seed, settings), settings, CarriedLidar(), seed=seed)
    return Driven(scanned=scanned, told=perceived(scanned, scanned.scans[0]))


@cache
def found_along(*, length_m: float, seed: int) -> dict[str, Found]:
    """What is found along a straight street driven once, by kind, "pole" (trunks and signs too) and "corner"."""
    drive = driven_along(length_m=length_m, seed=seed)
    scanned, places = drive.scanned, things_of(drive.told)
    seen_poles, seen_corners = seen_on(scanned)
    scene, scale = scanned.scene, scanned.scene.scale
    pole_m = poles_of(scene).place_m
    corner_m = scene.buildings.corner_m.reshape(-1, 2) / scale
    return {
        POLE: _held(places[POLE], pole_m, seen_poles),
        CORNER: _held(places[CORNER], corner_m, seen_corners),
    }


def _held(found_m: Floats, true_m: Floats, seen: NDArray[np.bool_]) -> Found:
    away_m, _ = cKDTree(true_m).query(found_m) if len(found_m) else (np.zeros(0), None)
    missed_m, _ = cKDTree(found_m).query(true_m[seen]) if len(found_m) else (np.full(seen.sum(), np.inf), None)
    return Found(
        found=len(found_m),
        true=int((away_m <= NEAR_M).sum()),
        seen=int(seen.sum()),
        recalled=int((missed_m <= NEAR_M).sum()),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Poles:
    """All poles and trunks: their axes (n, 2) in m over the ground from the campus's corner, and radii (n,) in m."""

    place_m: Floats
    radius_m: Floats


def poles_of(scene: Scene) -> Poles:
    """The poles of a scene, then its trees' trunks."""
    return Poles(
        place_m=np.vstack([scene.poles.place_m, scene.trees.place_m]) / scene.scale,
        radius_m=np.concatenate([scene.poles.radius_m, scene.trees.trunk_radius_m]),
    )


def things_of(told: list[tuple[LandmarksPerceived, Floats]]) -> dict[str, Floats]:
    """Where each thing that was tracked stands (n, 2), by kind: the median of its sights laid out by the true poses, in
    metres over the ground from the campus's corner."""
    sights: dict[tuple[str, int], list[Floats]] = {}
    for event, pose in told:
        turn = np.array([[np.cos(pose[2]), -np.sin(pose[2])], [np.sin(pose[2]), np.cos(pose[2])]])
        for one in event.landmarks:
            sights.setdefault((one.kind, one.track), []).append(pose[:2] + turn @ np.array([one.x_m, one.y_m]))
    places: dict[str, list[Floats]] = {POLE: [], CORNER: []}
    for (kind, _), seen in sights.items():
        places[kind].append(np.median(seen, axis=0))
    return {kind: np.array(each).reshape(-1, 2) for kind, each in places.items()}


def perceived(scanned: ScannedCampus, drive: DriveScans) -> list[tuple[LandmarksPerceived, Floats]]:
    """What was found in each sweep, and where the base truly was at its stamp."""
    (odometry,) = drives_of(scanned.campus.recordings[0].rows)
    follower = SweepFollower("veh", "boot", PerceptionSettings(), wheels=wheel_path(odometry))
    stamps = drive.stamp_ns()
    told: list[tuple[int, SweepPerceived]] = []
    for first in range(0, len(drive), SWEEPS_AT_ONCE):
        for number, event in enumerate(drive.events(first, min(first + SWEEPS_AT_ONCE, len(drive))), start=first):
            told += follower.take(NumberedSweep(sequence=number, stamp_ns=int(stamps[number]), scanned=event))
    told += follower.finished()
    poses = drive.base_poses(drive.begin_s())
    return [(event, poses[event.sweep_sequence]) for _, event in told if isinstance(event, LandmarksPerceived)]


def seen_on(scanned: ScannedCampus) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which poles and trunks (n,), and which corners of buildings (m,), were hit well enough in enough sweeps."""
    drive, scene = scanned.scans[0], scanned.scene
    upright = Counter[str]()
    corners = np.zeros(4 * len(scene.buildings.name), dtype=np.int64)
    for sweep in range(len(drive)):
        seen = seen_in(drive, sweep)
        hits = Counter(drive.solids.name[solid].removeprefix("sign of ") for solid in seen.solid[seen.solid >= 0])
        upright.update(name for name, count in hits.items() if count >= SEEN_POINTS)
        corners += _corners_hit(seen, drive, scene.buildings.corner_m / scene.scale)
    trunks = [name for name in drive.solids.name if f"crown of {name}" in drive.solids.name]
    names = (*scene.poles.name, *trunks)
    return np.array([upright[name] >= SEEN_SWEEPS for name in names]), corners >= SEEN_SWEEPS


def _corners_hit(seen: Seen, drive: DriveScans, footprint_m: Floats) -> NDArray[np.bool_]:
    """Which corners (4 n,) of footprints (n, 4, 2) have points enough on both their walls."""
    names = [name for name in drive.solids.name if name.startswith("building of ")]
    first = drive.solids.name.index(names[0])
    hit = np.zeros((len(footprint_m), 4), dtype=bool)
    for building in np.unique(seen.solid[(seen.solid >= first) & (seen.solid < first + len(names))]):
        point_m = seen.point_m[seen.solid == building, :2]
        corners = footprint_m[building - first]
        for n, corner_m in enumerate(corners):
            both = [_on_wall(point_m - corner_m, corners[(n + step) % 4] - corner_m) for step in (1, 3)]
            hit[building - first, n] = min(both) >= WALL_POINTS
    return hit.ravel()


def _on_wall(point_m: Floats, wall_m: Floats) -> int:
    """How many points (n, 2) lie on the beginning of a wall that runs from the origin."""
    along = wall_m / np.hypot(*wall_m)
    run_m, off_m = point_m @ along, point_m @ np.array([-along[1], along[0]])
    return int(((run_m > 0.0) & (run_m < WALL_REACH_M) & (np.abs(off_m) < WALL_OFF_M)).sum())

"""A short straight drive with a lidar, and the places of its points in the world."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from trigpoint_vehicle.core.campus import simulate_campus
from trigpoint_vehicle.core.campus_settings import CampusSettings, RouteSettings, with_plan
from trigpoint_vehicle.core.lidar.beams import shots_of
from trigpoint_vehicle.core.lidar.scanned_campus import ScannedCampus, scanned_campus
from trigpoint_vehicle.core.lidar.scans import DriveScans
from trigpoint_vehicle.core.lidar_settings import CarriedLidar, LidarSettings

Floats = NDArray[np.float64]
SEED = 5
EXACT = LidarSettings(
    range_sigma_m=0.0, return_scatter=0.0, intensity_scatter=0.0, dropout=0.0, beam_divergence_rad=0.0
)


@cache
def scanned(*, vehicles: int = 1) -> ScannedCampus:
    """150 m of a street, driven with a lidar that makes no errors."""
    settings = CampusSettings(vehicles=vehicles, route=RouteSettings(straight_length_m=150.0))
    settings = with_plan(settings, "straight")
    return scanned_campus(simulate_campus(SEED, settings), settings, CarriedLidar(lidar=EXACT), seed=SEED)


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """Points (n, 3) in the world in m over the ground, and of each: material, number of the solid (-1 the ground),
    place of the sensor (n, 3) when it was measured."""

    point_m: Floats
    material: NDArray[np.uint8]
    solid: NDArray[np.int32]
    sensor_m: Floats


def seen_in(drive: DriveScans, sweep: int, *, deskewed: bool = True) -> Seen:
    """One sweep laid into the world by the true pose of every column, or all of it by that of its begin."""
    shots, taken = shots_of(drive.settings), drive.taken(sweep, sweep + 1)
    begin_s = drive.begin_s()[sweep]
    place, axes = drive.sensor_poses(begin_s + (shots.column_s if deskewed else np.zeros(len(shots.column_s))))
    range_m = taken.range_m[0].reshape(shots.offset_ns.shape).astype(np.float64)
    aim = np.einsum("cij,cbj->cbi", axes, shots.direction)
    point_m = (place[:, None, :] + aim * range_m[..., None]).reshape(-1, 3)
    back = np.isfinite(taken.range_m[0])
    sensor_m = np.repeat(place, shots.direction.shape[1], axis=0)
    return Seen(
        point_m=point_m[back], material=taken.material[0][back], solid=taken.solid[0][back], sensor_m=sensor_m[back]
    )

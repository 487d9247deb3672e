"""What a spinning lidar measures of level ground, upright cylinders and walls."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.scanned import PointsScanned

Floats = NDArray[np.float64]

SENSOR_M = np.array([0.5, 0.0, 1.8])
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 100_000_000
RANGE_M = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """Cylinders (n, 4): x, y, radius, height in m; walls (m, 5): begin x, y, end x, y, height."""

    cylinders: Floats
    walls: Floats

    @property
    def pole_m(self) -> Floats:
        """The cylinders' axes (n, 2)."""
        return self.cylinders[:, :2]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """A spinning lidar: elevations of its lasers in degrees, columns a turn, 1-sigma of a range in m."""

    elevation_deg: tuple[float, ...]
    columns: int = 1800
    sigma_m: float = 0.02


SIXTEEN = Sensor(elevation_deg=tuple(float(angle) for angle in np.linspace(-15.0, 15.0, 16)))
SIXTY_FOUR = Sensor(elevation_deg=tuple(float(angle) for angle in np.linspace(-24.8, 2.0, 64)))

STREET = World(
    cylinders=np.array(
        [
            [8.0, 4.0, 0.08, 6.0],
            [14.0, -5.0, 0.12, 7.0],
            [-9.0, 6.0, 0.06, 5.0],
            [20.0, 6.0, 0.15, 8.0],
            [3.0, -7.0, 0.25, 6.0],
        ]
    ),
    walls=np.array(
        [
            [-20.0, 14.0, -4.0, 14.0, 8.0],
            [-4.0, 14.0, -4.0, 30.0, 8.0],
            [6.0, -12.0, 30.0, -12.0, 6.0],
            [6.0, -12.0, 6.0, -25.0, 6.0],
        ]
    ),
)
OTHER_STREET = World(
    cylinders=np.array(
        [
            [5.0, -6.0, 0.10, 6.0],
            [11.0, 8.0, 0.09, 7.0],
            [-5.0, -9.0, 0.07, 5.0],
            [17.0, 3.5, 0.13, 8.0],
            [24.0, -3.0, 0.20, 6.0],
            [-12.0, 3.0, 0.11, 6.0],
        ]
    ),
    walls=np.array([[-8.0, 17.0, 9.0, 17.0, 8.0], [9.0, 17.0, 9.0, 32.0, 8.0]]),
)
CORNERS_M = np.array([[-4.0, 14.0], [6.0, -12.0]])


def swept(
    world: World,
    sensor: Sensor,
    *,
    pose: Floats | None = None,
    velocity: tuple[float, float] = (0.0, 0.0),
    rng: np.random.Generator | None = None,
) -> PointsScanned:
    """One sweep from the base at pose (3,): x, y in m, heading in rad at the stamp, moving by velocity: speed in m/s,
    yaw rate in rad/s. It turns clockwise, looks ahead at the stamp, and sees nothing (NaN) farther than 60 m."""
    azimuth_rad = np.linspace(np.pi, -np.pi, sensor.columns, endpoint=False)
    offset_s = -azimuth_rad / (2.0 * np.pi) * PERIOD_NS * 1e-9
    base = _driven(np.zeros(3) if pose is None else pose, velocity, offset_s)
    elevation_rad = np.radians(sensor.elevation_deg)
    azimuth_rad, elevation_rad = (grid.ravel() for grid in np.meshgrid(azimuth_rad, elevation_rad, indexing="ij"))
    base = np.repeat(base, len(sensor.elevation_deg), axis=0)
    heading = base[:, 2] + azimuth_rad
    origin = base[:, :2] + np.column_stack([np.cos(base[:, 2]), np.sin(base[:, 2])]) * SENSOR_M[0]
    direction = np.column_stack([np.cos(heading), np.sin(heading)])
    run_m = _nearest_runs(world, origin, direction, np.tan(elevation_rad))
    range_m = run_m / np.cos(elevation_rad)
    range_m += (rng or np.random.default_rng(1)).normal(0.0, sensor.sigma_m, len(range_m))
    range_m[~(range_m < RANGE_M)] = np.nan
    unit = np.column_stack(
        [
            np.cos(elevation_rad) * np.cos(azimuth_rad),
            np.cos(elevation_rad) * np.sin(azimuth_rad),
            np.sin(elevation_rad),
        ]
    )
    lasers = len(sensor.elevation_deg)
    return PointsScanned(
        sensor="roof",
        sensor_position_m=SENSOR_M,
        sensor_orientation=LEVEL,
        point_m=(unit * range_m[:, None]).astype(np.float32),
        intensity=np.ones(len(range_m), dtype=np.float32),
        offset_ns=np.repeat((offset_s * 1e9).astype(np.int32), lasers),
        ring=np.tile(np.arange(lasers, dtype=np.uint16), sensor.columns),
    )


def driven_pose(velocity: tuple[float, float], seconds: float) -> Floats:
    """The pose (3,) after driving so long from the origin."""
    pose: Floats = _driven(np.zeros(3), velocity, np.array([seconds]))[0]
    return pose


def _driven(pose: Floats, velocity: tuple[float, float], offset_s: Floats) -> Floats:
    """Poses (n, 3) so long before or after one of constant speed and yaw rate."""
    speed_mps, yaw_rate_radps = velocity
    turn = yaw_rate_radps * offset_s
    chord_m = speed_mps * offset_s * np.sinc(turn / (2.0 * np.pi))
    heading = pose[2] + 0.5 * turn
    x_m, y_m = pose[0] + chord_m * np.cos(heading), pose[1] + chord_m * np.sin(heading)
    return np.column_stack([x_m, y_m, pose[2] + turn])


def _nearest_runs(world: World, origin: Floats, direction: Floats, rise: Floats) -> Floats:
    """The horizontal distance (n,) to the first thing each ray meets, infinite where it meets none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        run_m = np.where(rise < 0.0, SENSOR_M[2] / -rise, np.inf)
        for x, y, radius, height in world.cylinders:
            towards = np.array([x, y]) - origin
            along = np.einsum("ij,ij->i", towards, direction)
            across = towards[:, 0] * direction[:, 1] - towards[:, 1] * direction[:, 0]
            hit = along - np.sqrt(radius**2 - across**2)
            run_m = np.where(_is_hit(hit, rise, height) & (hit < run_m), hit, run_m)
        for x0, y0, x1, y1, height in world.walls:
            along_wall = np.array([x1 - x0, y1 - y0])
            across = direction[:, 0] * along_wall[1] - direction[:, 1] * along_wall[0]
            to_begin = np.array([x0, y0]) - origin
            hit = (to_begin[:, 0] * along_wall[1] - to_begin[:, 1] * along_wall[0]) / across
            share = (to_begin[:, 0] * direction[:, 1] - to_begin[:, 1] * direction[:, 0]) / across
            inside = (share >= 0.0) & (share <= 1.0)
            run_m = np.where(inside & _is_hit(hit, rise, height) & (hit < run_m), hit, run_m)
    return run_m


def _is_hit(hit_m: Floats, rise: Floats, height_m: float) -> NDArray[np.bool_]:
    at_m = SENSOR_M[2] + hit_m * rise
    hit: NDArray[np.bool_] = (hit_m > 0.0) & (at_m >= 0.0) & (at_m <= height_m)
    return hit

"""The sweeps of one drive, cast a few at a time as they are asked for: a whole drive's points fit no memory."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from trigpoint.events.scanned import PointsScanned
from trigpoint_vehicle.core.lidar.beams import Shots, shots_of
from trigpoint_vehicle.core.lidar.casting import Optics, Taken, World, cast_sweeps, sensor_poses
from trigpoint_vehicle.core.lidar.solids import NamedSolids, mover_states
from trigpoint_vehicle.core.lidar_settings import LidarSettings
from trigpoint_vehicle.core.motion import Motion
from trigpoint_vehicle.core.scene.materials import intensities, reflectivities
from trigpoint_vehicle.core.scene.world import Scene, Session

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SWEEPS_AT_ONCE = 16  # half a second of one core's work, some 10 MB
NOISE = 107  # the stream of noise, after those of `scene.world`


def optics_of(settings: LidarSettings, shots: Shots) -> Optics:
    """A sensor's shots and limits as the casting takes them."""
    rotation = Rotation.from_euler("ZYX", [settings.yaw_rad, settings.pitch_rad, settings.roll_rad])
    return Optics(
        direction=shots.direction,
        azimuth=settings.yaw_rad + np.pi - 2.0 * np.pi * settings.rate_hz * shots.column_s,
        column_s=shots.column_s,
        position=np.array([settings.x_m, settings.y_m, settings.z_m]),
        rotation=rotation.as_matrix(),
        range_min_m=settings.range_min_m,
        range_max_m=settings.range_max_m,
        range_sigma_m=settings.range_sigma_m,
        divergence_rad=settings.beam_divergence_rad,
        return_limit=settings.return_limit,
        return_scatter=settings.return_scatter,
        intensity_scatter=settings.intensity_scatter,
        dropout=settings.dropout,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveScans:
    """All sweeps of drive `number` through its session of a scene; with `seed` it says which noise the sensor has.

    Sweeps begin at the motion's multiples of the turn's duration; the last is whole.
    """

    scene: Scene
    session: Session
    solids: NamedSolids
    motion: Motion
    settings: LidarSettings
    first_stamp_ns: int
    seed: int
    number: int = 0

    def begin_s(self) -> Floats:
        """When each sweep (s,) begins, by the motion's time."""
        count = int(np.floor(float(self.motion.time_s[-1]) * self.settings.rate_hz + 1e-9))
        begin_s: Floats = np.arange(count) / self.settings.rate_hz
        return begin_s

    def stamp_ns(self) -> Ints:
        """When each sweep (s,) begins."""
        return self.first_stamp_ns + np.rint(self.begin_s() * 1e9).astype(np.int64)

    def base_poses(self, time_s: Floats) -> Floats:
        """The base's true x, y in m over the ground from the campus's corner and heading in rad (..., 3) at times."""
        motion = self.motion
        columns = [np.interp(time_s, motion.time_s, motion.pose[:, axis]) for axis in range(3)]
        return np.stack([columns[0] / self.scene.scale, columns[1] / self.scene.scale, columns[2]], axis=-1)

    def taken(self, first: int, last: int) -> Taken:
        """What came back in the sweeps from `first` to before `last`."""
        shots, begin_s = shots_of(self.settings), self.begin_s()[first:last]
        world = World(self.scene.ground, self.solids.solids, reflectivities(), intensities())
        base = self.base_poses(begin_s[:, None] + shots.column_s)
        movers = mover_states(self.scene, self.session, begin_s)
        return cast_sweeps(world, optics_of(self.settings, shots), base, movers, self._noise_seeds()[first:last])

    def sensor_poses(self, time_s: Floats) -> tuple[Floats, Floats]:
        """The sensor's true places (n, 3) and axes (n, 3, 3) in the world at times (n,), in m over the ground."""
        shots = shots_of(self.settings)
        return sensor_poses(self.scene.ground.wave, optics_of(self.settings, shots), self.base_poses(time_s))

    def _noise_seeds(self) -> NDArray[np.uint64]:
        words = np.random.SeedSequence([self.seed, NOISE, self.number]).generate_state(len(self), np.uint64)
        return words.astype(np.uint64)

    def events(self, first: int, last: int) -> list[PointsScanned]:
        """The sweeps from `first` to before `last` as the sensor says them: what did not come back is left out."""
        shots, taken = shots_of(self.settings), self.taken(first, last)
        return [self._event(shots, range_m, told) for range_m, told in zip(taken.range_m, taken.intensity, strict=True)]

    def __len__(self) -> int:
        return len(self.begin_s())

    def _event(self, shots: Shots, range_m: NDArray[np.float32], told: NDArray[np.float32]) -> PointsScanned:
        settings, back = self.settings, np.isfinite(range_m)
        direction = shots.direction.reshape(-1, 3)[back]
        rotation = Rotation.from_euler("ZYX", [settings.yaw_rad, settings.pitch_rad, settings.roll_rad])
        return PointsScanned(
            sensor=settings.name,
            sensor_position_m=np.array([settings.x_m, settings.y_m, settings.z_m]),
            sensor_orientation=rotation.as_quat(),
            point_m=(direction * range_m[back, None]).astype(np.float32),
            intensity=told[back],
            offset_ns=shots.offset_ns.ravel()[back],
            ring=np.tile(shots.ring, settings.columns)[back],
        )

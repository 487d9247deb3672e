"""What a lidar measured, as it said it. Writer: ingest, after validation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class PointsScanned:
    """One sweep of a lidar, n points in the order they were measured in; a foxglove.PointCloud on the wire.

    `point_m` (n, 3) float32: x, y, z in the sensor's frame (x ahead, y left, z up), NaN where nothing came back.
    `intensity` (n,) float32 in the sensor's own unit; `offset_ns` (n,) int32: when each point was measured, after the
    event's stamp (before it where negative), 0 where the sensor does not say; `ring` (n,) uint16: the laser.
    The sensor in the base frame (z up from the ground under the rear axle): `sensor_position_m` (3,) and
    `sensor_orientation` (4,), a unit quaternion x, y, z, w that turns the sensor's axes into the base's.
    """

    sensor: str
    sensor_position_m: Floats
    sensor_orientation: Floats
    point_m: NDArray[np.float32]
    intensity: NDArray[np.float32]
    offset_ns: NDArray[np.int32]
    ring: NDArray[np.uint16]

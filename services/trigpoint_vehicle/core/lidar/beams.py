"""The directions and times of a 16-beam spinning lidar's shots (Velodyne VLP-16 manual, 63-9243)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint_vehicle.core.lidar_settings import LidarSettings

Floats = NDArray[np.float64]

FIRING_ELEVATION_DEG = (-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15)  # in the order they fire in
BEAMS = len(FIRING_ELEVATION_DEG)
FIRING_STEP_NS = 2304  # from one laser to the next within a column


@dataclass(frozen=True, slots=True, kw_only=True)
class Shots:
    """All shots of one sweep, columns (c) of 16 (b), in the order they are fired in.

    direction (c, b, 3): of length 1 in the sensor's frame, x ahead, y left, z up; offset_ns (c, b) int32 after the
    sweep's begin; ring (b,) uint16, 0 the lowest; column_s (c,): when each column begins, after the sweep's begin.
    """

    direction: Floats
    offset_ns: NDArray[np.int32]
    ring: NDArray[np.uint16]
    column_s: Floats


def shots_of(settings: LidarSettings) -> Shots:
    """The shots of a turn that begins looking back and goes clockwise, so that what is ahead comes in the middle."""
    turn_s = 1.0 / settings.rate_hz
    column_s = (np.arange(settings.columns) * (turn_s / settings.columns)).astype(np.float64)
    offset_ns = np.rint(column_s[:, None] * 1e9).astype(np.int64) + FIRING_STEP_NS * np.arange(BEAMS)
    azimuth = np.pi - 2.0 * np.pi * (offset_ns * 1e-9 / turn_s)
    elevation = np.radians(FIRING_ELEVATION_DEG)
    level = np.cos(elevation)
    direction = np.stack(
        [level * np.cos(azimuth), level * np.sin(azimuth), np.broadcast_to(np.sin(elevation), azimuth.shape)], axis=-1
    )
    return Shots(
        direction=direction,
        offset_ns=offset_ns.astype(np.int32),
        ring=np.argsort(np.argsort(FIRING_ELEVATION_DEG)).astype(np.uint16),
        column_s=column_s,
    )

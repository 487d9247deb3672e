"""The map that sweeps are matched to, which another process can go on with."""

from collections import deque

import numpy as np
import small_gicp
from numpy.typing import NDArray

Floats = NDArray[np.float64]

KEPT_SWEEPS = 100  # a voxel not hit for so long is forgotten
CLEARED_EVERY = 10
NEIGHBOURS = 10  # for a point's own covariance

State = tuple[float, tuple[tuple[Floats, Floats], ...]]


class KeptMap:
    """Voxels with the mean and covariance of the points of the sweeps that hit them.

    The last sweeps are kept as they went in: pickled, the map is those, and made of them anew. It then lacks what older
    sweeps added to voxels that were hit without a break: after more than `KEPT_SWEEPS` sweeps it is not the very same.
    """

    def __init__(self, voxel_m: float) -> None:
        self._begin(voxel_m)

    def insert(self, cloud: small_gicp.PointCloud, placed: Floats) -> None:
        """A sweep at its place `placed` (4, 4); cloud: its points with their covariances."""
        self.voxels.insert(cloud, placed)
        self._kept.append((np.array(cloud.points())[:, :3], np.array(placed)))

    def _begin(self, voxel_m: float) -> None:
        self._voxel_m = voxel_m
        self._kept: deque[tuple[Floats, Floats]] = deque(maxlen=KEPT_SWEEPS)
        self.voxels = small_gicp.GaussianVoxelMap(voxel_m)
        self.voxels.set_lru(KEPT_SWEEPS, CLEARED_EVERY)

    def __getstate__(self) -> State:
        return self._voxel_m, tuple(self._kept)

    def __setstate__(self, state: State) -> None:
        voxel_m, kept = state
        self._begin(voxel_m)
        for point_m, placed in kept:
            cloud = small_gicp.PointCloud(point_m)
            small_gicp.estimate_covariances(cloud, num_neighbors=NEIGHBOURS, num_threads=1)
            self.insert(cloud, placed)

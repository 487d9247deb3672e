"""Lidar odometry: each sweep matched to a map of those before it (VGICP, Koide et al. 2021, by small_gicp)."""

from dataclasses import dataclass

import numpy as np
import small_gicp
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint_perception.core.kept_map import NEIGHBOURS, KeptMap
from trigpoint_perception.core.planar import by_parent, in_parent_axes, planar_pose
from trigpoint_perception.settings import OdometrySettings

Floats = NDArray[np.float64]

ROTATION_STEP_RAD = 1e-3  # a step as short as these is the last: each is a small share of the one before it
TRANSLATION_STEP_M = 5e-3
ITERATIONS_MAX = 20  # then points only change voxels to and fro, and the place by less than a millimetre
HASH = 73_856_093, 19_349_663, 83_492_791  # of a voxel's place (Teschner et al. 2003)
PLANAR = np.ix_([3, 4, 2], [3, 4, 2])  # x, y, heading of a twist: rotation first, then translation


@dataclass(frozen=True, slots=True, kw_only=True)
class Match:
    """A sweep's place: `T_odom_base` (4, 4); its covariance (3, 3) of x, y and heading in its own base frame; the share
    of its points with a partner; and why it is not to be relied on, if so (it then is where it was expected)."""

    T_odom_base: Floats
    covariance: Floats
    matched_share: float
    refusal: str


class LidarOdometry:
    """Sweeps matched one after the other, in a frame that begins at the first one. One thread, the same each time."""

    def __init__(self, settings: OdometrySettings) -> None:
        self._settings = settings
        self._map = KeptMap(settings.voxel_m)
        self._begun = False

    def matched(self, point_m: Floats, expected: Floats) -> Match:
        """The place of a deskewed sweep, points (n, 3) in the base frame, expected at `expected` (4, 4)."""
        settings = self._settings
        cloud = small_gicp.PointCloud(downsampled(point_m, settings.downsampled_m))
        small_gicp.estimate_covariances(cloud, num_neighbors=NEIGHBOURS, num_threads=1)
        if not self._begun:
            self._begun = True
            self._map.insert(cloud, expected)
            return Match(T_odom_base=expected, covariance=np.zeros((3, 3)), matched_share=1.0, refusal="")
        found = small_gicp.align(
            self._map.voxels,
            cloud,
            expected,
            max_correspondence_distance=settings.reach_m,
            num_threads=1,
            max_iterations=ITERATIONS_MAX,
            rotation_epsilon=ROTATION_STEP_RAD,
            translation_epsilon=TRANSLATION_STEP_M,
        )
        share = found.num_inliers / max(cloud.size(), 1)
        covariance = planar_covariance(
            np.asarray(found.H), float(found.error), found.num_inliers, inflation=settings.inflation
        )
        refusal = _refusal(share, covariance, settings)
        placed = expected if refusal else np.asarray(found.T_target_source)
        self._map.insert(cloud, placed)
        return Match(T_odom_base=placed, covariance=covariance, matched_share=share, refusal=refusal)


@compiled
def downsampled(point_m: Floats, voxel_m: float) -> Floats:
    """The mean (m, 3) of the points (n, 3) of each cubic voxel, in the order of the voxels' first points."""
    slots = 2
    while slots < 2 * len(point_m):
        slots *= 2
    holder, voxel_at = np.full(slots, -1, np.int64), np.empty((len(point_m), 3), np.int64)
    total, count = np.empty((len(point_m), 3)), np.zeros(len(point_m))
    found = 0
    for row in range(len(point_m)):
        x = int(np.floor(point_m[row, 0] / voxel_m))
        y = int(np.floor(point_m[row, 1] / voxel_m))
        z = int(np.floor(point_m[row, 2] / voxel_m))
        slot = ((x * HASH[0]) ^ (y * HASH[1]) ^ (z * HASH[2])) & (slots - 1)
        while holder[slot] >= 0:
            there = voxel_at[holder[slot]]
            if there[0] == x and there[1] == y and there[2] == z:
                break
            slot = (slot + 1) & (slots - 1)
        voxel = holder[slot]
        if voxel < 0:
            voxel = found
            holder[slot] = voxel
            voxel_at[voxel, 0], voxel_at[voxel, 1], voxel_at[voxel, 2] = x, y, z
            total[voxel] = 0.0
            found += 1
        count[voxel] += 1.0
        for axis in range(3):
            total[voxel, axis] += point_m[row, axis]
    return total[:found] / count[:found].reshape(-1, 1)


def _refusal(share: float, covariance: Floats, settings: OdometrySettings) -> str:
    if share < settings.share_min:
        return f"{share:.2f} of the points found a partner, at least {settings.share_min:g} have to"
    loosest_m = float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
    if not loosest_m <= settings.sigma_max_m:
        return f"1-sigma of {loosest_m:.2g} m along the loosest direction, over {settings.sigma_max_m:g} m"
    return ""


def planar_covariance(information: Floats, error: float, inliers: int, *, inflation: float) -> Floats:
    """The covariance (3, 3) of x, y, heading from the match's information (6, 6), rotation first.

    Neighbouring points see the same surface, so that as many points tell less than they would alone: the covariance is
    wider by `inflation`, and by the residuals where they are larger than the points' own covariances say.
    """
    values, vectors = np.linalg.eigh(information)
    values = np.maximum(values, 1e-6 * values[-1])  # a direction nothing fixes is loose, not infinite
    full = (vectors / values) @ vectors.T
    scale = max(1.0, 2.0 * error / max(3 * inliers, 1)) * inflation
    planar: Floats = full[PLANAR] * scale
    return planar


def relative_pose(before: Match, after: Match, settings: OdometrySettings) -> tuple[Floats, Floats]:
    """The base's motion (3,), x, y in m and heading in rad, between two matches, and its covariance (3, 3).

    Both places are uncertain against the map; what the map's own drift and the level frame leave out is a floor and a
    share of the distance.
    """
    motion = planar_pose(np.linalg.inv(before.T_odom_base) @ after.T_odom_base)
    across_m = settings.floor_sigma_m + settings.share_of_distance * float(np.hypot(motion[0], motion[1]))
    floor = np.diag([across_m**2, across_m**2, settings.floor_sigma_rad**2])
    return motion, in_parent_axes(after.covariance, float(motion[2])) + by_parent(before.covariance, motion) + floor

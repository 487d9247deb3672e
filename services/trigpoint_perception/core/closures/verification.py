"""A proposed place held against the points of both times (GICP: Segal et al. 2009, by small_gicp)."""

from dataclasses import dataclass

import numpy as np
import small_gicp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trigpoint.geodesy.poses import wrap_angle_rad
from trigpoint_perception.core.closures.clouds import Cloud
from trigpoint_perception.core.closures.settings import VerificationSettings
from trigpoint_perception.core.odometry import ROTATION_STEP_RAD, planar_covariance
from trigpoint_perception.core.planar import by_parent, in_parent_axes, planar_pose, spatial_pose

Floats = NDArray[np.float64]

ITERATIONS_MAX = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """The base at the one as seen from the base at the other by points, T_other_one (3,), with covariance (3, 3) as
    OdometryMatched has it; the share of upright points that match, the lower of both ways; `refusal` why the points do
    not bear the place out, else empty."""

    T_other_one: Floats
    covariance: Floats
    matched_share: float
    refusal: str


def verified(one: Cloud, other: Cloud, expected: Floats, settings: VerificationSettings) -> Verification:
    """One cloud laid on the other, expected at T_other_one (3,)."""
    found = small_gicp.align(
        other.points,
        one.points,
        other.tree,
        init_T_target_source=spatial_pose(expected),
        registration_type="GICP",
        max_correspondence_distance=settings.reach_m,
        num_threads=1,
        max_iterations=ITERATIONS_MAX,
        rotation_epsilon=ROTATION_STEP_RAD,
    )
    T_other_one = np.asarray(found.T_target_source)
    own = planar_covariance(np.asarray(found.H), float(found.error), found.num_inliers, inflation=settings.inflation)
    laid_m = one.upright_m @ T_other_one[:3, :3].T + T_other_one[:3, 3]
    share = min(_share(laid_m, other.upright_m, settings), _share(other.upright_m, laid_m, settings))
    pose = planar_pose(T_other_one)
    return Verification(
        T_other_one=pose,
        covariance=in_parent_axes(own + one.covariance, float(pose[2]))
        + by_parent(other.covariance, pose)
        + _floor(settings),
        matched_share=share,
        refusal=_refusal(pose - expected, own, share, settings),
    )


def _share(point_m: Floats, among_m: Floats, settings: VerificationSettings) -> float:
    """The share of points (n, 3) that have one of (m, 3) near them; 0 where either are none."""
    if not len(point_m) or not len(among_m):
        return 0.0
    away_m, _ = cKDTree(among_m).query(point_m, distance_upper_bound=settings.near_m)
    return float(np.isfinite(away_m).mean())


def _refusal(off: Floats, covariance: Floats, share: float, settings: VerificationSettings) -> str:
    loosest_m = float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
    turned_rad = abs(wrap_angle_rad(float(off[2])))
    if share < settings.share_min:
        return "few points match"
    if float(np.hypot(*off[:2])) > settings.moved_max_m or turned_rad > settings.moved_max_rad:
        return "points and landmarks disagree"
    if not loosest_m <= settings.sigma_max_m:
        return "points leave a direction loose"
    return ""


def _floor(settings: VerificationSettings) -> Floats:
    """What the points do not tell of: a few bent surfaces, and the level frame."""
    return np.diag([settings.floor_sigma_m**2, settings.floor_sigma_m**2, settings.floor_sigma_rad**2])

"""A drive among landmarks of known identity finds its way in a frame of its own."""

import numpy as np
import pytest
from numpy.typing import NDArray

from trigpoint.geodesy.poses import transform_points, wrap_angles_rad
from trigpoint_optimisation.core.joining import rigid_onto
from trigpoint_optimisation.core.known_landmark_slam import KnownSightings, LocalMap, local_map
from trigpoint_optimisation.core.odometry import relative_poses

Floats = NDArray[np.float64]

POSTS_M = np.array([(0.0, 6.0), (9.0, 0.0), (4.0, 11.0), (12.0, 9.0), (-3.0, -2.0)])
NOISE = np.diag([0.05**2, 0.02**2, 0.02**2])


def circle() -> Floats:
    """True poses (n, 3): twice around a circle of 4 m radius."""
    angle = np.linspace(0.0, 4.0 * np.pi, 121)
    return np.column_stack([4.0 + 4.0 * np.cos(angle), 5.0 + 4.0 * np.sin(angle), angle + 0.5 * np.pi])


def followed(*, misread: int = 0, turn_scale: float = 1.0) -> tuple[LocalMap, Floats]:
    """The local map of the circle, so many of its first sightings being of another post, and the true poses."""
    pose, rng = circle(), np.random.default_rng(2)
    keyframe, post = (index.ravel() for index in np.indices((len(pose), len(POSTS_M))))
    ray = POSTS_M[post] - pose[keyframe, :2]
    bearing = wrap_angles_rad(np.arctan2(ray[:, 1], ray[:, 0]) - pose[keyframe, 2]) + rng.normal(0.0, 0.01, len(post))
    named = post.copy()
    named[:misread] = (post[:misread] + 1) % len(POSTS_M)
    delta = relative_poses(pose[:-1], pose[1:]) * (1.0, 1.0, turn_scale)
    sightings = KnownSightings(
        keyframe=keyframe,
        landmark=named,
        ln_range=np.log(np.hypot(*ray.T)) + rng.normal(0.0, 0.02, len(post)),
        bearing_rad=bearing,
        T_keyframe_sensor=np.zeros((len(post), 3)),
    )
    noise = np.broadcast_to(NOISE, (len(delta), 3, 3))
    return local_map(delta, noise, sightings, landmark_count=len(POSTS_M)), pose


def worst_m(found: LocalMap) -> float:
    """The largest distance of a post from where it is, after the best rigid motion."""
    here = {str(post): point for post, point in enumerate(found.landmark_m)}
    motion = rigid_onto(here, {str(post): point for post, point in enumerate(POSTS_M)})
    assert motion is not None
    return float(np.hypot(*(transform_points(motion, found.landmark_m) - POSTS_M).T).max())


def test_all_landmarks_are_found_up_to_a_rigid_motion() -> None:
    found, _ = followed()
    assert worst_m(found) < 0.05  # m: range noise is 2 % of 10 m, seen 121 times
    assert (found.count == 121).all()


def test_the_path_starts_at_its_own_origin_and_keeps_its_shape() -> None:
    found, pose = followed()
    expected = relative_poses(np.broadcast_to(pose[0], pose.shape), pose)
    np.testing.assert_allclose(found.pose[0], 0.0, atol=0.01)  # m and rad: what is known of the start
    np.testing.assert_allclose(found.pose[:, :2], expected[:, :2], atol=0.15)  # m, of a circle of 8 m


def test_odometry_that_turns_a_tenth_too_far_does_not_bend_the_map() -> None:
    found, _ = followed(turn_scale=1.1)
    assert worst_m(found) < 0.2  # m; dead reckoning alone is wrong by 1.3 rad in the end


@pytest.mark.parametrize("misread", [1, 2])
def test_a_misread_first_sighting_is_taken_back(misread: int) -> None:
    found, _ = followed(misread=misread)
    assert worst_m(found) < 0.2  # m; the posts taken for one another are over 9 m apart

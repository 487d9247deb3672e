"""Detections on the earth: where they are, and how what is uncertain adds up."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from landmark_maps.examples import frame
from trigpoint.client.core.constellations import Constellation
from trigpoint.client.core.placing import VehiclePose, placed, true_from_grid
from trigpoint.errors import InputError
from trigpoint.geodesy.poses import transform_points
from trigpoint.geodesy.projection import map_points_from_wgs84

FRAME = frame()
POSE = VehiclePose(
    T_map_base=np.array([120.0, -40.0, 0.7]),
    covariance=np.array([[0.04, 0.01, 0.001], [0.01, 0.09, -0.002], [0.001, -0.002, 0.0004]]),
)
SEEN = Constellation(
    point_m=np.array([[20.0, 3.0], [8.0, -12.0]]),
    covariance_m2=np.array([[[0.02, 0.0], [0.0, 0.05]], [[0.03, 0.01], [0.01, 0.02]]]),
    kind=("pole", "pole"),
)


def sampled(count: int) -> NDArray[np.float64]:
    """Positions (count, 4) of both detections on the grid, with errors drawn for pose and detections."""
    random = np.random.default_rng(3)
    poses = random.multivariate_normal(POSE.T_map_base, POSE.covariance, count)
    parts = []
    for point_m, covariance_m2 in zip(SEEN.point_m, SEEN.covariance_m2, strict=True):
        drawn = random.multivariate_normal(point_m, covariance_m2, count)
        parts.append(transform_points(poses, FRAME.point_scale * drawn))
    return np.concatenate(parts, axis=1)


def test_a_detection_ahead_is_where_the_vehicle_looks() -> None:
    pose = VehiclePose(T_map_base=np.array([0.0, 0.0, math.pi / 2]), covariance=np.zeros((3, 3)))
    ahead = Constellation(point_m=np.array([[10.0, 0.0]]), covariance_m2=np.eye(2)[None], kind=("pole",))
    found = placed(ahead, pose, FRAME)
    # 10 m on the ground are `point_scale` times as many on the grid, to the north of it; rounding only.
    assert found.point_m[0] == pytest.approx([0.0, 10.0 * FRAME.point_scale], abs=1e-9)
    back_m = map_points_from_wgs84(found.lat_deg, found.lon_deg, FRAME)
    assert back_m == pytest.approx(found.point_m, abs=1e-6)  # a micrometre: both ways through the projection


def test_covariances_are_those_of_drawn_errors() -> None:
    points_m = sampled(200_000)
    R_true_map = np.kron(np.eye(2), true_from_grid(FRAME))
    expected_m2 = R_true_map @ np.cov(points_m.T) @ R_true_map.T
    found = placed(SEEN, POSE, FRAME).joint_covariance_m2
    # 200,000 draws know a variance to 0.3 %; the second order of the heading's error, 0.02 rad, adds as little.
    assert found == pytest.approx(expected_m2, rel=0.02, abs=2e-3)


def test_each_detections_own_covariance_stands_on_the_diagonal() -> None:
    found = placed(SEEN, POSE, FRAME)
    assert np.array_equal(found.covariance_m2[1], found.joint_covariance_m2[2:, 2:])


def test_a_pose_known_exactly_leaves_the_detections_error_turned() -> None:
    pose = VehiclePose(T_map_base=np.array([0.0, 0.0, 0.0]), covariance=np.zeros((3, 3)))
    found = placed(SEEN, pose, FRAME)
    assert np.trace(found.covariance_m2[0]) == pytest.approx(0.07, rel=1e-9)  # metres on the ground, whatever the grid
    assert np.abs(found.joint_covariance_m2[:2, 2:]).max() == 0.0


def test_nothing_seen_is_nothing_placed() -> None:
    nothing = Constellation(point_m=np.zeros((0, 2)), covariance_m2=np.zeros((0, 2, 2)), kind=())
    found = placed(nothing, POSE, FRAME)
    assert (found.lat_deg.shape, found.covariance_m2.shape) == ((0,), (0, 2, 2))


@pytest.mark.parametrize(
    ("pose", "covariance", "reason"),
    [
        (np.zeros(2), np.eye(3), "pose of shape"),
        (np.array([0.0, np.nan, 0.0]), np.eye(3), "not finite"),
        (np.zeros(3), -np.eye(3), "eigenvalue of -1"),
    ],
)
def test_a_pose_that_is_none_is_refused(
    pose: NDArray[np.float64], covariance: NDArray[np.float64], reason: str
) -> None:
    with pytest.raises(InputError, match=reason):
        VehiclePose(T_map_base=pose, covariance=covariance)

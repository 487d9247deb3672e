"""Marginals agree with the dense inverse, and an undetermined map is refused."""

import math

import gtsam
import numpy as np
import pytest

from trigpoint.errors import AlignmentRefused
from trigpoint_optimisation.core.factors import anchor_factor
from trigpoint_optimisation.core.marginals import Reduced, covariance_of, pose_covariances, reduced
from trigpoint_optimisation.core.state import image_key, landmark_key

LANDMARKS = 3


def labelled_graph() -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """Three landmarks labelled in one image: they share its offset, so their errors hang together."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    values.insert(image_key(0), np.zeros(2))
    graph.add(gtsam.PriorFactorVector(image_key(0), np.zeros(2), gtsam.noiseModel.Isotropic.Sigma(2, 0.35)))
    for j in range(LANDMARKS):
        values.insert(landmark_key(j), np.array([10.0 * j, 0.0]))
        noise = gtsam.noiseModel.Isotropic.Sigma(2, 0.1)
        graph.add(anchor_factor((landmark_key(j), image_key(0)), np.array([10.0 * j + 0.05, 0.0]), noise=noise))
    return graph, values


def test_landmarks_of_one_image_share_its_error() -> None:
    graph, values = labelled_graph()
    covariance = covariance_of(reduced(graph, values, [landmark_key(j) for j in range(LANDMARKS)]))
    expected = 0.35**2 * np.kron(np.ones((3, 3)), np.eye(2)) + 0.1**2 * np.eye(6)
    np.testing.assert_allclose(covariance, expected, atol=1e-9)  # m^2, rounding


def test_the_kept_states_come_in_the_order_asked_for() -> None:
    graph, values = labelled_graph()
    graph.add(gtsam.PriorFactorPoint2(landmark_key(2), np.zeros(2), gtsam.noiseModel.Isotropic.Sigma(2, 1e-3)))
    covariance = covariance_of(reduced(graph, values, [landmark_key(2), landmark_key(0)]))
    assert covariance[0, 0] == pytest.approx(1e-6, rel=1e-3)  # the well-known one first
    assert covariance[2, 2] > 0.01


def test_the_gradient_leads_to_the_solution() -> None:
    graph, values = labelled_graph()
    kept = reduced(graph, values, [landmark_key(j) for j in range(LANDMARKS)])
    step = np.linalg.solve(kept.information, kept.gradient)
    np.testing.assert_allclose(step, np.tile([0.05, 0.0], LANDMARKS), atol=1e-9)  # m, rounding


def test_a_map_that_nothing_fixes_is_refused() -> None:
    with pytest.raises(AlignmentRefused, match="nothing fixes the map's place"):
        covariance_of(Reduced(information=np.array([[1.0, -1.0], [-1.0, 1.0]]), gradient=np.zeros(2)))


def test_a_pose_covariance_is_in_the_frame_of_the_map() -> None:
    # Sure ahead, unsure across; heading north, so east is what is unsure.
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    pose = gtsam.Pose2(1.0, 2.0, math.pi / 2)
    values.insert(0, pose)
    graph.add(gtsam.PriorFactorPose2(0, pose, gtsam.noiseModel.Diagonal.Sigmas(np.array([0.1, 2.0, 0.01]))))
    (covariance,) = pose_covariances(gtsam.Marginals(graph, values), values, [0])
    np.testing.assert_allclose(np.diag(covariance), [4.0, 0.01, 1e-4], rtol=1e-9)  # rounding

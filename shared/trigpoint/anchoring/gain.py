"""What one more label would tell of the whole map: by how much it lowers the summed variance of all landmarks.

A label of landmark i lies where the landmark is, shifted by its image's offset: h = x_i + o. With P the joint
covariance of all landmarks x and offsets o, a label of noise R lowers the landmarks' covariance by
P_xh (P_hh + R)^-1 P_hx (the Kalman update; R. E. Kalman, 1960), whose trace is tr((P_hh + R)^-1 P_hx P_xh). P_hh and
P_hx P_xh are all that is needed of the map, whatever the label's sigma.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def label_terms(joint_covariance_m2: Floats, *, landmark_count: int, image: int | None) -> tuple[Floats, Floats]:
    """P_hh in m^2 and P_hx P_xh in m^4, (l, 3) each: xx, xy, yy of a label of each landmark.

    joint_covariance_m2 (2l + 2k, 2l + 2k): landmarks, then image offsets, x and y of each in turn. `image`: the number
    of the offset the labels share, None for none that the map knows.
    """
    count = 2 * landmark_count
    joint = joint_covariance_m2
    numbers = np.arange(landmark_count)
    rows = joint[:count, :count].reshape(landmark_count, 2, count)  # of each landmark, with all of them
    expected = joint[:count, :count].reshape(landmark_count, 2, landmark_count, 2)[numbers, :, numbers, :]
    shared = rows @ rows.transpose(0, 2, 1)
    if image is not None:
        own = slice(count + 2 * image, count + 2 * image + 2)
        offset = joint[own, :count]
        expected = _with_both(expected, joint[:count, own].reshape(landmark_count, 2, 2), joint[own, own])
        shared = _with_both(shared, rows @ offset.T, offset @ offset.T)
    return _upper(expected), _upper(shared)


def variance_reductions_m2(expected_m2: Floats, shared_m4: Floats, *, sigma_m: float) -> Floats:
    """By how much labels (l,) of 1-sigma `sigma_m` per axis each lower the summed variance of all landmarks, in m^2;
    of the terms (l, 3) of `label_terms`."""
    xx, xy, yy = expected_m2.T + np.array([[1.0], [0.0], [1.0]]) * sigma_m**2
    shared_xx, shared_xy, shared_yy = shared_m4.T
    reduced: Floats = (yy * shared_xx - 2.0 * xy * shared_xy + xx * shared_yy) / (xx * yy - xy**2)
    return reduced


def _with_both(landmark: Floats, mixed: Floats, offset: Floats) -> Floats:
    """The products (l, 2, 2) of a sum with itself, by those of its parts: a landmark's and an offset's."""
    return landmark + mixed + mixed.transpose(0, 2, 1) + offset


def _upper(symmetric: Floats) -> Floats:
    """The entries xx, xy, yy (l, 3) of symmetric matrices (l, 2, 2)."""
    return symmetric.reshape(-1, 4)[:, [0, 1, 3]]

"""A factor's Jacobians held against numeric ones."""

import gtsam
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STEP = 1e-6  # of the central difference: its own error is about 1e-9 here, far below the tolerance
SLOPE = 1e-5  # tolerance of a derivative, relative and absolute


def values_of(*states: Floats | gtsam.Pose2) -> gtsam.Values:
    """The states under keys 0, 1, ..."""
    values = gtsam.Values()
    for key, state in enumerate(states):
        values.insert(key, state)
    return values


def _moved(values: gtsam.Values, key: int, column: int, step: float) -> gtsam.Values:
    change = gtsam.VectorValues()
    size = 3 if key in _poses_in(values) else len(values.atVector(key))
    change.insert(key, step * np.eye(size)[column])
    return values.retract(change)


def _poses_in(values: gtsam.Values) -> set[int]:
    return set(gtsam.utilities.allPose2s(values).keys())


def _numeric_jacobian(factor: gtsam.NoiseModelFactor, values: gtsam.Values, key: int, size: int) -> Floats:
    columns = [
        factor.unwhitenedError(_moved(values, key, column, STEP))
        - factor.unwhitenedError(_moved(values, key, column, -STEP))
        for column in range(size)
    ]
    return np.column_stack(columns) / (2.0 * STEP)


def assert_derivatives(factor: gtsam.NoiseModelFactor, values: gtsam.Values, sizes: tuple[int, ...]) -> None:
    """The factor, under unit noise, linearises to its numeric derivatives by states 0, 1, ... of the given sizes."""
    analytic, _ = factor.linearize(values).jacobian()
    numeric = np.hstack([_numeric_jacobian(factor, values, key, size) for key, size in enumerate(sizes)])
    np.testing.assert_allclose(analytic, numeric, rtol=SLOPE, atol=SLOPE)

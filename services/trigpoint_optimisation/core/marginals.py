"""Marginals of a solved graph: what remains when everything but a few states is eliminated."""

from collections.abc import Sequence
from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import AlignmentRefused
from trigpoint_optimisation.core.gauss_newton import elimination_order

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reduced:
    """A Gaussian in information form over kept two-dimensional states (m): information (2m, 2m), gradient (2m,)."""

    information: Floats
    gradient: Floats


def reduced(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, kept: Sequence[int]) -> Reduced:
    """The graph at `values` marginalised onto the kept states, in their order (Schur complement)."""
    linear = graph.linearize(values)
    chosen = set(kept)
    order = elimination_order(linear, kept)
    eliminated = gtsam.Ordering()
    for position in range(order.size()):
        if order.at(position) not in chosen:
            eliminated.push_back(order.at(position))
    _, remaining = linear.eliminatePartialMultifrontal(eliminated)
    last = gtsam.Ordering()
    for key in kept:
        last.push_back(key)
    information, gradient = remaining.hessian(last)
    return Reduced(information=np.asarray(information), gradient=np.asarray(gradient))


def pose_covariances(marginals: gtsam.Marginals, values: gtsam.Values, keys: Sequence[int]) -> Floats:
    """Covariances (n, 3, 3) of poses in the map frame: x, y in m, heading in rad."""
    covariance = np.empty((len(keys), 3, 3))
    for row, key in enumerate(keys):
        heading = values.atPose2(key).theta()
        turn = np.array([[np.cos(heading), -np.sin(heading), 0.0], [np.sin(heading), np.cos(heading), 0.0], [0, 0, 1]])
        covariance[row] = turn @ marginals.marginalCovariance(key) @ turn.T
    return covariance


def vector_sigmas(marginals: gtsam.Marginals, keys: Sequence[int]) -> tuple[Floats, ...]:
    """The 1-sigma of every component of each vector state, in the state's own units."""
    return tuple(np.sqrt(np.diag(marginals.marginalCovariance(key))) for key in keys)


def covariance_of(kept: Reduced) -> Floats:
    """The covariance (2m, 2m) of a reduction.

    Raises AlignmentRefused where the data leave the kept states undetermined.
    """
    try:
        factor = np.linalg.cholesky(kept.information)
    except np.linalg.LinAlgError as error:
        raise AlignmentRefused("the landmarks' information is singular: nothing fixes the map's place") from error
    inverse = np.linalg.inv(factor)
    covariance: Floats = inverse.T @ inverse
    return covariance

"""Gauss-Newton over a gtsam graph, with the states that everything hangs on eliminated last."""

from collections.abc import Sequence

import gtsam

MAX_ITERATIONS = 15
MAX_HALVINGS = 4
RELATIVE_TOLERANCE = 3e-4  # of the cost, per iteration
ABSOLUTE_TOLERANCE = 1e-3  # of the cost, dimensionless


def _shortened(step: gtsam.VectorValues, keys: Sequence[int], factor: float) -> gtsam.VectorValues:
    shorter = gtsam.VectorValues()
    for key in keys:
        shorter.insert(key, step.at(key) * factor)
    return shorter


def elimination_order(linear: gtsam.GaussianFactorGraph, last: Sequence[int]) -> gtsam.Ordering:
    """A fill-reducing order that ends with `last`: eliminated early, a state many factors share fills the graph."""
    return gtsam.Ordering.ColamdConstrainedLastGaussianFactorGraph(linear, list(last))


def solved(
    graph: gtsam.NonlinearFactorGraph,
    values: gtsam.Values,
    *,
    last: Sequence[int],
    max_iterations: int = MAX_ITERATIONS,
) -> gtsam.Values:
    """The values at the nearest minimum of the graph's cost; steps are halved while they do not lower it."""
    cost = graph.error(values)
    order = None
    keys = list(values.keys())
    for _ in range(max_iterations):
        linear = graph.linearize(values)
        order = order or elimination_order(linear, last)
        step = linear.optimize(order)
        factor = 1.0
        moved = values.retract(step)
        moved_cost = graph.error(moved)
        while moved_cost > cost and factor > 0.5**MAX_HALVINGS:
            factor *= 0.5
            moved = values.retract(_shortened(step, keys, factor))
            moved_cost = graph.error(moved)
        if moved_cost > cost:
            return values
        gain, values, cost = cost - moved_cost, moved, moved_cost
        if gain < max(ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE * cost):
            break
    return values

"""The minimum is reached, and no step is taken that makes matters worse."""

import gtsam
import numpy as np
import pytest

from trigpoint_optimisation.core.gauss_newton import elimination_order, solved


def place_of(values: gtsam.Values) -> float:
    return float(values.atVector(0)[0])


def arctangent_graph() -> gtsam.NonlinearFactorGraph:
    """atan(x) = 0: full Gauss-Newton steps from beyond |x| = 1.39 fly apart."""

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: list[np.ndarray] | None) -> np.ndarray:
        x = float(values.atVector(0)[0])
        if jacobians is not None:
            jacobians[0] = np.array([[1.0 / (1.0 + x * x)]])
        return np.array([np.arctan(x)])

    graph = gtsam.NonlinearFactorGraph()
    graph.add(gtsam.CustomFactor(gtsam.noiseModel.Unit.Create(1), [0], error))
    return graph


def start_at(x: float) -> gtsam.Values:
    values = gtsam.Values()
    values.insert(0, np.array([x]))
    return values


@pytest.mark.parametrize("start", [0.5, 3.0, -8.0])
def test_steps_too_long_are_halved_until_they_lower_the_cost(start: float) -> None:
    found = solved(arctangent_graph(), start_at(start), last=[])
    assert place_of(found) == pytest.approx(0.0, abs=0.05)  # stops at a thousandth of cost: x^2 / 2


def test_the_cost_never_rises_from_one_iteration_to_the_next() -> None:
    graph = arctangent_graph()
    costs = [graph.error(solved(graph, start_at(3.0), last=[], max_iterations=count)) for count in range(6)]
    assert costs == sorted(costs, reverse=True)


def test_the_states_asked_for_are_eliminated_last() -> None:
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for key in range(20):
        values.insert(key, np.zeros(1))
        graph.add(gtsam.PriorFactorVector(key, np.ones(1), gtsam.noiseModel.Unit.Create(1)))
    order = elimination_order(graph.linearize(values), [3, 7])
    assert {order.at(18), order.at(19)} == {3, 7}

import math

import numpy as np

from trigpoint_evaluation.core.summary import NO_ERRORS, distances_m, summary_of


def test_a_summary_is_what_its_names_say() -> None:
    found = summary_of(np.array([3.0, 4.0, 0.0, 1.0]))
    assert (found.count, found.mean, found.median, found.max) == (4, 2.0, 2.0, 4.0)
    assert math.isclose(found.rmse, math.sqrt(26.0 / 4.0))
    assert math.isclose(found.p95, 3.85)  # linear between the third and the fourth value


def test_an_error_that_is_not_known_is_left_out_and_not_counted_as_none() -> None:
    assert summary_of(np.array([2.0, np.nan])) == summary_of(np.array([2.0]))


def test_no_errors_have_a_count_of_0_and_no_mean() -> None:
    assert summary_of(np.zeros(0)) is NO_ERRORS
    assert math.isnan(NO_ERRORS.mean)


def test_distances_are_those_of_pythagoras() -> None:
    assert distances_m(np.array([[0.0, 0.0]]), np.array([[3.0, -4.0]])).tolist() == [5.0]

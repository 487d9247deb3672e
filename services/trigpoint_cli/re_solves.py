"""Whether the linear reduction says of held-out labels what a full solve says."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.solved import LabelReduction
from trigpoint_evaluation.core.leave_out import held_out_of, held_out_residuals_m, linear_labels
from trigpoint_optimisation.core.anchoring import UNASSIGNED
from trigpoint_optimisation.core.fleet import solved_state
from trigpoint_optimisation.core.stages import Solved, full_graph

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Progress = Callable[[int, int], None]


def re_solve_differences_m(solved: Solved, reduction: LabelReduction, tied: Ints, progress: Progress) -> Floats:
    """Distances (k, h) in m between the held-out labels' predictions by the reduction and by full solves.

    `tied` (k, n) are draws of the reduction's label numbers; each full solve ties those labels to the landmarks they
    are tied to in `solved`, and no others.
    """
    linear = held_out_residuals_m(linear_labels(reduction), tied)
    held_out = held_out_of(len(reduction.labels), tied, np.arange(len(reduction.labels)))
    full = np.full(linear.shape, np.nan)
    for draw in range(len(tied)):
        full[draw] = _full_residuals_m(solved, reduction, tied[draw], held_out[draw])
        progress(draw + 1, len(tied))
    away_m: Floats = np.linalg.norm(full - linear, axis=-1)
    return away_m


def _full_residuals_m(solved: Solved, reduction: LabelReduction, tied: Ints, held_out: Ints) -> Floats:
    """Held-out labels minus their landmarks and image offsets (h, 2) in m, after a solve with `tied` labels."""
    rows = np.array([solved.labels.name.index(name) for name in reduction.labels])
    landmark = np.full(len(solved.labels.name), UNASSIGNED)
    landmark[rows[tied]] = solved.assignment.landmark[rows[tied]]
    chosen = replace(solved, assignment=replace(solved.assignment, landmark=landmark))
    state = solved_state(full_graph(chosen), solved.state)
    shift_m = np.vstack([state.image_m, np.zeros((1, 2))])[solved.labels.image[rows[held_out]]]
    predicted_m = state.landmark_m[solved.assignment.landmark[rows[held_out]]] + shift_m
    residual_m: Floats = solved.labels.label_m[rows[held_out]] - predicted_m
    return residual_m

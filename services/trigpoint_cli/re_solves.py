"""Whether the linear reduction says of held-out labels what a full solve says."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.anchoring.association import UNASSIGNED
from trigpoint.anchoring.labels import image_shifts_m
from trigpoint.events.solved import LabelReduction
from trigpoint_evaluation.core.leave_out import held_out_of, held_out_residuals_m, linear_labels
from trigpoint_evaluation.core.summary import ErrorSummary, summary_of
from trigpoint_optimisation.core.fleet import solved_state
from trigpoint_optimisation.core.stages import Solved, full_graph

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """How the reduction's predictions differ from full solves': `prediction_m` label by label, `mean_error_m` in the
    mean error over all draws, which is what is reported."""

    prediction_m: ErrorSummary
    mean_error_m: float


def agreement_with_re_solves(solved: Solved, reduction: LabelReduction, tied: Ints, progress: Progress) -> Agreement:
    """The agreement over draws `tied` (k, n) of the reduction's label numbers.

    Each full solve ties a draw's labels to the landmarks they are tied to in `solved`, and no others.
    """
    linear = held_out_residuals_m(linear_labels(reduction), tied)
    held_out = held_out_of(len(reduction.labels), tied, np.arange(len(reduction.labels)))
    full = np.full(linear.shape, np.nan)
    for draw in range(len(tied)):
        full[draw] = _full_residuals_m(solved, reduction, tied[draw], held_out[draw])
        progress(draw + 1, len(tied))
    error_m = np.linalg.norm(linear, axis=-1).mean() - np.linalg.norm(full, axis=-1).mean()
    return Agreement(
        prediction_m=summary_of(np.linalg.norm(full - linear, axis=-1)),
        mean_error_m=float(abs(error_m)),
    )


def _full_residuals_m(solved: Solved, reduction: LabelReduction, tied: Ints, held_out: Ints) -> Floats:
    """Held-out labels minus their landmarks and image offsets (h, 2) in m, after a solve with `tied` labels."""
    rows = np.nonzero(solved.assignment.landmark >= 0)[0]  # the labels the reduction has, in its order
    landmark = np.full(len(solved.labels.name), UNASSIGNED)
    landmark[rows[tied]] = solved.assignment.landmark[rows[tied]]
    chosen = replace(solved, assignment=replace(solved.assignment, landmark=landmark))
    state = solved_state(full_graph(chosen), solved.state)
    shift_m = image_shifts_m(solved.labels, state.image_m)[rows[held_out]]
    predicted_m = state.landmark_m[solved.assignment.landmark[rows[held_out]]] + shift_m
    residual_m: Floats = solved.labels.label_m[rows[held_out]] - predicted_m
    return residual_m

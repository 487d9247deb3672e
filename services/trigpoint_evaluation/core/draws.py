"""Which labels are tied, drawn at random or all but a block, and what many draws say together."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.events.solved import LabelReduction
from trigpoint_evaluation.core.leave_out import LinearLabels, held_out_errors_m, linear_labels
from trigpoint_evaluation.core.summary import ErrorSummary, summary_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Progress = Callable[[int, int], None]

MOST_LABELLED = "most-labelled"  # in place of an image's name: the one with most labels


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaveOutDraws:
    """How many draws, from which seed, and whether the held-out labels form a block."""

    draws: int
    seed: int
    blocked: bool = False

    def __post_init__(self) -> None:
        if self.draws < 1:
            raise InputError(f"{self.draws} draws: at least 1 is needed")
        if self.seed < 0:
            raise InputError(f"seed {self.seed}: seeds begin at 0")


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaveOutResult:
    """The errors of the held-out labels with `tied` of `count` labels tied, over `draws` draws.

    `error_m` pools all held-out labels of all draws; `band_m` are the 5th and 95th percentile of the draws' means.
    `undetermined` draws left the frame free and have no error.
    """

    tied: int
    count: int
    draws: int
    undetermined: int
    error_m: ErrorSummary
    band_m: tuple[float, float]


def image_labels(reduction: LabelReduction, image: str) -> tuple[str, Ints]:
    """An image's name and its labels' numbers. Raises InputError for an image without labels, naming those with."""
    numbers = reduction.image_index
    counts = [int(np.count_nonzero(numbers == index)) for index in range(len(reduction.images))]
    if image == MOST_LABELLED and counts:
        image = reduction.images[int(np.argmax(counts))]
    if image not in reduction.images:
        known = ", ".join(f"{name} ({count})" for name, count in zip(reduction.images, counts, strict=True))
        raise InputError(f"image {image!r} has no labels tied to landmarks; these have: {known or 'none'}")
    return image, np.flatnonzero(numbers == reduction.images.index(image))


def _chosen_labels(reduction: LabelReduction, image: str | None) -> Ints:
    """The numbers of all labels, or of one image's."""
    return np.arange(len(reduction.labels)) if image is None else image_labels(reduction, image)[1]


def random_draws(among: Ints, tied: int, draws: int, rng: np.random.Generator) -> Ints:
    """Label numbers (k, tied), each row a draw without repetition from `among`."""
    order = np.argsort(rng.random((draws, len(among))), axis=1)
    return among[order[:, :tied]]


def blocked_draws(among: Ints, point_m: Floats, tied: int, draws: int, rng: np.random.Generator) -> Ints:
    """Label numbers (k, tied): held out are those of `among` nearest to a random place, point_m (n, 2) in m."""
    low, high = point_m.min(axis=0), point_m.max(axis=0)
    place_m = low + (high - low) * rng.random((draws, 2))
    away_m = np.linalg.norm(point_m[None] - place_m[:, None], axis=2)
    order = np.argsort(-away_m, axis=1, kind="stable")
    return among[order[:, :tied]]


def left_out(
    reduction: LabelReduction, tied: int, settings: LeaveOutDraws, *, image: str | None = None
) -> LeaveOutResult:
    """The errors with `tied` labels tied, all other labels (of one image, if named) held out.

    Raises InputError if that leaves no label to measure.
    """
    among = _chosen_labels(reduction, image)
    if not 0 <= tied < len(among):
        raise InputError(f"{tied} labels tied: {len(among)} are there, so 0 to {len(among) - 1} can be")
    return _result(reduction, linear_labels(reduction), tied, settings, among)


def left_out_curve(
    reduction: LabelReduction,
    settings: LeaveOutDraws,
    *,
    image: str | None = None,
    progress: Progress | None = None,
) -> tuple[LeaveOutResult, ...]:
    """The errors for every number of labels tied, from none to all but one; nothing without labels."""
    among = _chosen_labels(reduction, image)
    labels, results = linear_labels(reduction), list[LeaveOutResult]()
    for tied in range(len(among)):
        results.append(_result(reduction, labels, tied, settings, among))
        if progress is not None:
            progress(tied + 1, len(among))
    return tuple(results)


def drawn_labels(reduction: LabelReduction, tied: int, settings: LeaveOutDraws, among: Sequence[int] | Ints) -> Ints:
    """The draws (k, tied) of label numbers that these settings give: the same for the same seed and `tied`."""
    numbers = np.asarray(among, dtype=np.int64)
    rng = np.random.default_rng([settings.seed, tied, int(settings.blocked)])
    if settings.blocked:
        return blocked_draws(numbers, reduction.label_m[numbers], tied, settings.draws, rng)
    return random_draws(numbers, tied, settings.draws, rng)


def _result(
    reduction: LabelReduction, labels: LinearLabels, tied: int, settings: LeaveOutDraws, among: Ints
) -> LeaveOutResult:
    chosen = drawn_labels(reduction, tied, settings, among)
    if tied == 0:
        chosen = chosen[:1]  # without ties every draw is the same
    error_m = held_out_errors_m(labels, chosen, among=among)
    known = ~np.isnan(error_m[:, 0])
    means = error_m[known].mean(axis=1)
    band = (float("nan"), float("nan")) if len(means) == 0 else tuple(np.percentile(means, [5.0, 95.0]).tolist())
    return LeaveOutResult(
        tied=tied,
        count=len(among),
        draws=len(chosen),
        undetermined=int(np.count_nonzero(~known)),
        error_m=summary_of(error_m),
        band_m=(band[0], band[1]),
    )


def untied_residuals_m(reduction: LabelReduction) -> Floats:
    """Label minus landmark (l, 2) in m with no label tied; NaN where the labels alone fix the frame."""
    labels = linear_labels(reduction)
    if labels.free.shape[1] > 0 or labels.count == 0:
        return np.full((labels.count, 2), np.nan)
    x = np.linalg.solve(labels.information, labels.gradient)
    residual: Floats = labels.reading_m - labels.design @ x
    return residual

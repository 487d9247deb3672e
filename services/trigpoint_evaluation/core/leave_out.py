"""Some labels tied, the others predicted: what the map would say of each label it was not given.

The reduction is linear and Gaussian, so a draw needs no new solve. A label is its landmark plus its image's offset
plus its own noise; a held-out label's prediction includes its image's offset as the tied labels of that image
tell it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.solved import LabelReduction

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

UNDETERMINED_RATIO = 1e-9  # eigenvalues of information below this share of the largest count as none
TIED_LENGTH = 1e-6  # tied labels must see every undetermined direction, of unit length over all labels, by this much
FREE_SIGMA_M = 1000.0  # 1-sigma along undetermined directions: pulls a determined frame by under 1e-8 of its shift
OFFSET_SIGMA_FLOOR_M = 1e-6  # an image said to be exact; keeps its prior's information finite
BATCH_CELLS = 20_000_000  # of one array, 160 MB


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearLabels:
    """The reduction as one Gaussian over x (d,): landmark shifts (x, y of each in turn), then image offsets, in m.

    The cost is 1/2 x' information x - gradient' x; label l reads `design[l] x` (2, d) as `reading_m[l]` (2,), each
    axis with 1-sigma `sigma_m[l]`. `free` (d, f) spans what the information leaves undetermined (f = 0: nothing).
    """

    information: Floats
    gradient: Floats
    design: Floats
    reading_m: Floats
    sigma_m: Floats
    free: Floats

    @property
    def count(self) -> int:
        """How many labels there are."""
        return len(self.sigma_m)


def linear_labels(reduction: LabelReduction) -> LinearLabels:
    """The reduction with the images' offsets among its unknowns."""
    points, images = len(reduction.landmarks), len(reduction.images)
    size = 2 * (points + images)
    information, gradient = np.zeros((size, size)), np.zeros(size)
    information[: 2 * points, : 2 * points] = 0.5 * (reduction.information + reduction.information.T)
    gradient[: 2 * points] = reduction.gradient
    prior = np.maximum(reduction.image_sigma_m, OFFSET_SIGMA_FLOOR_M) ** -2.0
    information[range(2 * points, size), range(2 * points, size)] = np.repeat(prior, 2)
    return LinearLabels(
        information=information,
        gradient=gradient,
        design=_design(reduction, size),
        reading_m=reduction.label_m - reduction.point_m[reduction.landmark_index],
        sigma_m=reduction.sigma_m,
        free=_undetermined(information[: 2 * points, : 2 * points], size),
    )


def _design(reduction: LabelReduction, size: int) -> Floats:
    design = np.zeros((len(reduction.labels), 2, size))
    rows = np.arange(len(reduction.labels))
    in_image = reduction.image_index >= 0
    offset_column = 2 * (len(reduction.landmarks) + reduction.image_index)
    for axis in (0, 1):
        design[rows, axis, 2 * reduction.landmark_index + axis] = 1.0
        design[rows[in_image], axis, offset_column[in_image] + axis] = 1.0
    return design


def _undetermined(information: Floats, size: int) -> Floats:
    values, vectors = np.linalg.eigh(information)
    free = values <= UNDETERMINED_RATIO * max(float(values[-1]), 0.0) if len(values) else np.zeros(0, dtype=bool)
    spanning = np.zeros((size, int(np.count_nonzero(free))))
    spanning[: len(values)] = vectors[:, free]
    return spanning


def held_out_of(count: int, tied: Ints, among: Ints) -> Ints:
    """The labels (k, h) of `among` that draws `tied` (k, n) leave out, rising, of `count` labels in all."""
    left = np.zeros((len(tied), count), dtype=bool)
    left[:, among] = True
    np.put_along_axis(left, tied, False, axis=1)
    return np.nonzero(left)[1].reshape(len(tied), -1)


def held_out_errors_m(labels: LinearLabels, tied: Ints, *, among: Ints | None = None) -> Floats:
    """Lengths (k, h) in m of `held_out_residuals_m`."""
    residual_m = held_out_residuals_m(labels, tied, among=among)
    away_m: Floats = np.hypot(residual_m[..., 0], residual_m[..., 1])
    return away_m


def held_out_residuals_m(labels: LinearLabels, tied: Ints, *, among: Ints | None = None) -> Floats:
    """Held-out labels minus their predictions (k, h, 2) in m, for draws `tied` (k, n) of label numbers.

    Held out are the labels of `among` (all, if not given) that a draw does not tie; labels outside it are not
    used at all. A draw that leaves the frame undetermined has NaN.
    """
    chosen = np.arange(labels.count) if among is None else among
    held_out = held_out_of(labels.count, tied, chosen)
    residual_m = np.full((*held_out.shape, 2), np.nan)
    determined = np.flatnonzero(_determined(labels, tied))
    batch = max(1, BATCH_CELLS // max(labels.information.size, 1))
    for first in range(0, len(determined), batch):
        some = determined[first : first + batch]
        predicted_m = _predicted_m(labels, tied[some], held_out[some])
        residual_m[some] = labels.reading_m[held_out[some]] - predicted_m
    return residual_m


def _determined(labels: LinearLabels, tied: Ints) -> NDArray[np.bool_]:
    free = labels.free.shape[1]
    if free == 0:
        return np.ones(len(tied), dtype=bool)
    if 2 * tied.shape[1] < free:
        return np.zeros(len(tied), dtype=bool)
    seen = (labels.design @ labels.free)[tied].reshape(len(tied), -1, free)
    lengths = np.linalg.svd(seen, compute_uv=False)
    fixed: NDArray[np.bool_] = lengths[:, -1] > TIED_LENGTH
    return fixed


def _predicted_m(labels: LinearLabels, tied: Ints, held_out: Ints) -> Floats:
    """Predictions (k, h, 2): conditioning in the space of labels (Rasmussen and Williams 2006, eq. 2.23)."""
    design = labels.design.reshape(2 * labels.count, -1)
    regular = labels.information + labels.free @ labels.free.T / FREE_SIGMA_M**2
    spread = np.linalg.solve(regular, np.column_stack([design.T, labels.gradient]))
    covariance, mean = design @ spread[:, :-1], design @ spread[:, -1]
    rows, columns = _axes_of(held_out), _axes_of(tied)
    predicted = mean[rows]
    if tied.shape[1] > 0:
        noisy = covariance[columns[:, :, None], columns[:, None, :]]
        noisy[:, range(columns.shape[1]), range(columns.shape[1])] += np.repeat(labels.sigma_m, 2)[columns] ** 2
        surprise = labels.reading_m.reshape(-1)[columns] - mean[columns]
        weight = np.linalg.solve(noisy, surprise[..., None])
        predicted = predicted + (covariance[rows[:, :, None], columns[:, None, :]] @ weight)[..., 0]
    return predicted.reshape(*held_out.shape, 2)


def _axes_of(label: Ints) -> Ints:
    """Both axes' rows (k, 2n) of labels (k, n)."""
    return np.stack([2 * label, 2 * label + 1], axis=-1).reshape(len(label), -1)

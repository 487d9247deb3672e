from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.events.solved import LabelReduction
from trigpoint_evaluation.core.draws import (
    LeaveOutDraws,
    image_labels,
    left_out,
    left_out_curve,
    untied_residuals_m,
)
from trigpoint_evaluation.core.leave_out import held_out_errors_m, linear_labels

Floats = NDArray[np.float64]
TOLERANCE_M = 1e-5  # two ways to solve the same equations, condition up to 1e10 where the frame is free


def reduction_of(*, seed: int, points: int = 8, images: int = 2, frame_fixed: bool = True) -> LabelReduction:
    """Landmarks tied to one another at 5 cm in a ring; where the frame is fixed, each also by 2 m to its place."""
    rng = np.random.default_rng(seed)
    point_m = rng.uniform(0.0, 200.0, (points, 2))
    information = np.zeros((2 * points, 2 * points))
    for axis in (0, 1):
        for one in range(points):
            row = np.zeros(2 * points)
            row[2 * one + axis], row[2 * ((one + 1) % points) + axis] = 1.0, -1.0
            information += np.outer(row, row) / 0.05**2
    information += np.eye(2 * points) / 2.0**2 if frame_fixed else 0.0
    image_index = np.arange(points) % (images + 1) - 1
    return LabelReduction(
        landmarks=tuple(f"landmark-{n}" for n in range(points)),
        point_m=point_m,
        information=information,
        gradient=information @ np.tile(rng.normal(0.0, 1.0, 2), points),
        labels=tuple(f"label-{n}" for n in range(points)),
        landmark_index=np.arange(points),
        label_m=point_m + rng.normal(0.0, 1.0, 2) + rng.normal(0.0, 0.1, (points, 2)),
        sigma_m=np.full(points, 0.1),
        image_index=image_index,
        images=tuple(f"image-{n}" for n in range(images)),
        image_sigma_m=np.full(images, 0.35),
    )


def brute_force_errors_m(reduction: LabelReduction, tied: list[int], held_out: list[int]) -> Floats:
    """One least-squares problem with a row for every label and every image's prior, by pseudo-inverse."""
    points, images = len(reduction.landmarks), len(reduction.images)
    values, vectors = np.linalg.eigh(reduction.information)
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    known = np.linalg.pinv(root, rcond=1e-9).T @ reduction.gradient
    rows, right = [np.hstack([root, np.zeros((2 * points, 2 * images))])], [known]
    rows.append(np.hstack([np.zeros((2 * images, 2 * points)), np.diag(1.0 / np.repeat(reduction.image_sigma_m, 2))]))
    right.append(np.zeros(2 * images))
    reading = reduction.label_m - reduction.point_m[reduction.landmark_index]

    def label_rows(label: int) -> Floats:
        block = np.zeros((2, 2 * (points + images)))
        block[:, 2 * reduction.landmark_index[label] : 2 * reduction.landmark_index[label] + 2] = np.eye(2)
        if reduction.image_index[label] >= 0:
            first = 2 * (points + int(reduction.image_index[label]))
            block[:, first : first + 2] = np.eye(2)
        return block

    for label in tied:
        rows.append(label_rows(label) / reduction.sigma_m[label])
        right.append(reading[label] / reduction.sigma_m[label])
    x = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0]
    return np.array([np.linalg.norm(reading[label] - label_rows(label) @ x) for label in held_out])


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), tied=st.integers(0, 7), frame_fixed=st.booleans())
def test_held_out_errors_are_those_of_a_full_least_squares_solve(seed: int, tied: int, frame_fixed: bool) -> None:
    reduction = reduction_of(seed=seed, frame_fixed=frame_fixed)
    draw = np.random.default_rng(seed).permutation(8)
    found = held_out_errors_m(linear_labels(reduction), draw[None, :tied])[0]
    if tied == 0 and not frame_fixed:
        assert np.isnan(found).all()
        return
    expected = brute_force_errors_m(reduction, draw[:tied].tolist(), sorted(draw[tied:].tolist()))
    np.testing.assert_allclose(found, expected, atol=TOLERANCE_M)


def test_a_tied_label_moves_the_labels_that_hang_together_with_it() -> None:
    reduction = reduction_of(seed=3)
    errors = [left_out(reduction, tied, LeaveOutDraws(draws=50, seed=1)).error_m.mean for tied in (0, 4)]
    assert errors[1] < errors[0]


def test_one_image_s_labels_are_tied_and_measured_alone() -> None:
    reduction = reduction_of(seed=3, points=9)
    result = left_out(reduction, 2, LeaveOutDraws(draws=7, seed=1), image="image-1")
    assert (result.count, result.error_m.count) == (3, 7)


def test_most_labelled_stands_for_the_image_with_most_labels() -> None:
    reduction = reduction_of(seed=3, points=8)
    name, numbers = image_labels(reduction, "most-labelled")
    assert (name, numbers.tolist()) == ("image-0", [1, 4, 7])


def test_an_image_without_labels_is_refused_with_the_images_that_have_some() -> None:
    with pytest.raises(InputError, match=r"image 'nowhere'.*image-0 \(3\)"):
        image_labels(reduction_of(seed=3), "nowhere")


def test_tying_every_label_is_refused_with_the_limit() -> None:
    with pytest.raises(InputError, match="8 labels tied: 8 are there, so 0 to 7"):
        left_out(reduction_of(seed=3), 8, LeaveOutDraws(draws=1, seed=0))


def test_the_same_seed_gives_the_same_curve() -> None:
    reduction, draws = reduction_of(seed=5), LeaveOutDraws(draws=20, seed=9)
    assert left_out_curve(reduction, draws) == left_out_curve(reduction, draws)


def test_draws_that_leave_the_frame_free_are_counted_and_have_no_error() -> None:
    nothing = left_out(reduction_of(seed=5, frame_fixed=False), 0, LeaveOutDraws(draws=20, seed=9))
    assert (nothing.undetermined, nothing.error_m.count) == (1, 0)


def test_a_block_left_out_is_predicted_worse_than_as_many_left_out_at_random() -> None:
    reduction = correlated_reduction()
    random = left_out(reduction, 30, LeaveOutDraws(draws=200, seed=2))
    blocked = left_out(reduction, 30, LeaveOutDraws(draws=200, seed=2, blocked=True))
    assert blocked.error_m.mean > random.error_m.mean


@cache
def correlated_reduction() -> LabelReduction:
    """40 landmarks whose map error is smooth over 60 m, sigma 2 m: a neighbour tells much, a far one little."""
    rng = np.random.default_rng(7)
    point_m = rng.uniform(0.0, 300.0, (40, 2))
    away_m = np.linalg.norm(point_m[:, None] - point_m[None], axis=2)
    kernel = np.kron(4.0 * np.exp(-((away_m / 60.0) ** 2)) + 1e-3 * np.eye(40), np.eye(2))
    information = np.linalg.inv(kernel)
    shift_m = rng.multivariate_normal(np.zeros(80), kernel).reshape(40, 2)
    return LabelReduction(
        landmarks=tuple(map(str, range(40))),
        point_m=point_m,
        information=information,
        gradient=np.zeros(80),
        labels=tuple(map(str, range(40))),
        landmark_index=np.arange(40),
        label_m=point_m + shift_m,
        sigma_m=np.full(40, 0.1),
        image_index=np.full(40, -1),
        images=(),
        image_sigma_m=np.zeros(0),
    )


def test_residuals_without_ties_are_those_of_the_map_alone() -> None:
    reduction = reduction_of(seed=11)
    alone = np.linalg.norm(untied_residuals_m(reduction), axis=1)
    np.testing.assert_allclose(alone, held_out_errors_m(linear_labels(reduction), np.zeros((1, 0), int))[0], atol=1e-9)

"""Wheels whose momentary speeds were sampled once a second: what is wobble and what is a turn."""

from dataclasses import fields, replace

import numpy as np
import pytest

from driven_paths.examples import Course, driven
from trigpoint_optimisation.core.odometry import TurnSource, turn_source
from trigpoint_optimisation.core.sampled_wheels import (
    coarsely_sampled,
    sampled_turn_variance,
    without_wobble,
    wobble_radps,
)

SECOND_NS = 1_000_000_000
SPEED_MPS = np.full(2000, 1.3)


def test_one_sample_a_second_is_coarse_and_ten_are_not() -> None:
    stamp_ns = np.arange(50, dtype=np.int64) * SECOND_NS
    assert coarsely_sampled(stamp_ns)
    assert not coarsely_sampled(stamp_ns // 10)


@pytest.mark.parametrize(
    ("every", "track_m", "source"),
    [(1, 0.57, TurnSource.WHEELS), (10, 0.57, TurnSource.SAMPLED_WHEELS), (10, 0.0, TurnSource.COMMAND)],
)
def test_only_measured_wheels_far_apart_count_as_sampled(every: int, track_m: float, source: TurnSource) -> None:
    drive = driven(Course(turns_by="wheels")).drive
    wheels = type(drive.wheels)(**{f.name: getattr(drive.wheels, f.name)[::every] for f in fields(drive.wheels)})
    assert turn_source(replace(drive, wheels=wheels, described=replace(drive.described, track_m=track_m))) is source


def test_the_wobble_is_read_from_the_samples_themselves() -> None:
    rate = 0.1 * np.random.default_rng(7).standard_normal(2000)
    assert abs(wobble_radps(rate, SPEED_MPS) - 0.1) < 0.01  # rad/s: three sigmas of a median of 2000


def test_a_lasting_turn_is_not_wobble() -> None:
    slow = 0.5 * np.sin(np.arange(2000) / 20.0)  # rad/s, a turn of a minute
    assert wobble_radps(slow, SPEED_MPS) < 0.001  # rad/s: its second difference, 0.5 / 20^2


def test_standing_says_nothing_of_the_wobble() -> None:
    assert wobble_radps(np.random.default_rng(7).standard_normal(2000), np.zeros(2000)) == 0.0


def test_wobble_goes_and_turns_stay() -> None:
    rate = np.asarray(0.1 * (-1.0) ** np.arange(100), dtype=np.float64)
    rate[40:60] = 0.8
    kept = without_wobble(rate, 0.1)
    assert np.abs(kept[:38]).max() < 0.03  # rad/s: the ends of the record smooth over two samples only
    assert np.allclose(kept[42:58], 0.8, atol=0.02)  # rad/s: the gain there is 1 - (0.1 / 0.8)^2


def test_without_wobble_nothing_is_changed() -> None:
    rate = np.random.default_rng(7).standard_normal(50)
    assert np.array_equal(without_wobble(rate, 0.0), rate)


def test_the_headings_variance_starts_at_nothing_and_adds_up() -> None:
    variance = sampled_turn_variance(np.full(4, 1.3), np.zeros(4), np.ones(4))
    assert variance[0] == 0.0
    assert np.allclose(np.diff(variance), 0.02**2 + (0.06 * 1.3) ** 2)

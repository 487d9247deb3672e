"""The noise of a drive's fixes, told by the fixes themselves."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from driven_paths.examples import ANTENNA_M, FRAME, Course, Driven, driven
from trigpoint_optimisation.core.fix_noise import WHITE_LEAST_SHARE, fix_residuals, measured_fix_settings
from trigpoint_optimisation.core.preparation import PreparedDrive, nominal_calibration, prepared_drive
from trigpoint_optimisation.core.state import DriveState
from trigpoint_optimisation.settings import HONEST_EDGES, FixSettings, SolveSettings

Floats = NDArray[np.float64]

LONG = Course(duration_s=900.0, turn_radps=0.05)


def at_the_truth(world: Driven) -> tuple[PreparedDrive, DriveState]:
    """A drive ready for the graph, its keyframes where they really were."""
    settings = SolveSettings()
    calibration = nominal_calibration(world.drive, settings.calibration, point_scale=FRAME.point_scale)
    prepared = prepared_drive(world.drive, FRAME, settings, index=0, calibration=calibration)
    state = DriveState(
        pose=world.pose_at(prepared.stamp_ns),
        scale=np.array([FRAME.point_scale, 1.0, 0.0]),
        turn_bias=np.zeros(len(calibration.turn_bias)),
        antenna_m=ANTENNA_M,
        fix_bias_m=np.zeros((0, 2)),
        sensor=np.zeros(6),
    )
    return prepared, state


def measured(world: Driven) -> FixSettings:
    prepared, state = at_the_truth(world)
    return measured_fix_settings(prepared, state, prepared.fix_usable, HONEST_EDGES)


def with_slow_error(world: Driven, sigma_m: float, *, white_m: float, time_s: float = 60.0) -> Driven:
    """The world with white noise and a Gauss-Markov error on its fixes."""
    rng, count = np.random.default_rng(8), len(world.drive.fixes.stamp_ns)
    decay = np.exp(-1.0 / time_s)
    slow = np.zeros((count, 2))
    slow[0] = rng.normal(0.0, sigma_m, 2)
    for row in range(1, count):
        slow[row] = decay * slow[row - 1] + rng.normal(0.0, sigma_m * np.sqrt(1.0 - decay**2), 2)
    return world.with_shift(slow + rng.normal(0.0, white_m, (count, 2)), np.ones(count, dtype=bool))


@pytest.mark.parametrize("white_m", [1.5, 3.0])
def test_the_white_part_is_right_within_a_fifth(white_m: float) -> None:
    assert measured(driven(replace(LONG, white_m=white_m))).sigma_m == pytest.approx(white_m, rel=0.2)


def test_the_white_part_is_right_beside_a_slow_error() -> None:
    assert measured(with_slow_error(driven(LONG), 4.0, white_m=3.0)).sigma_m == pytest.approx(3.0, rel=0.2)


@pytest.mark.parametrize("slow_m", [1.0, 5.0])
def test_the_white_part_is_never_below_its_share_of_the_slow_one(slow_m: float) -> None:
    found = measured(with_slow_error(driven(LONG), slow_m, white_m=0.2))
    assert found.sigma_m == pytest.approx(WHITE_LEAST_SHARE * found.bias_sigma_m)


def test_the_slow_part_is_never_below_the_given_one() -> None:
    assert measured(driven(replace(LONG, white_m=0.5))).bias_sigma_m == HONEST_EDGES.bias_sigma_m


def test_a_larger_slow_part_is_seen() -> None:
    # 900 s hold 15 times the 60 s of the error: its sigma is known to a fifth, medians to a quarter.
    assert measured(with_slow_error(driven(LONG), 5.0, white_m=1.0)).bias_sigma_m == pytest.approx(5.0, rel=0.3)


def test_the_given_duration_stays() -> None:
    assert measured(with_slow_error(driven(LONG), 5.0, white_m=1.0)).bias_time_s == HONEST_EDGES.bias_time_s


def test_a_standing_receiver_says_nothing_of_its_noise() -> None:
    assert measured(driven(replace(LONG, speed_mps=0.0))) == HONEST_EDGES


def test_too_few_fixes_keep_the_given_settings() -> None:
    world = driven(Course(duration_s=15.0))
    assert measured(world) == HONEST_EDGES


def test_untrusted_fixes_have_no_say() -> None:
    world = driven(replace(LONG, white_m=2.0))
    wild = np.arange(len(world.drive.fixes.stamp_ns)) % 10 == 0
    prepared, state = at_the_truth(world.with_shift(np.array([400.0, 0.0]), wild))
    found = measured_fix_settings(prepared, state, prepared.fix_usable & ~wild, HONEST_EDGES)
    assert found.sigma_m == pytest.approx(2.0, rel=0.2)


def test_residuals_are_fix_less_antenna_at_the_fixes_own_time() -> None:
    # Noiseless fixes, most of them between keyframes: taken at the nearest one they would be off by up to 1 m.
    prepared, state = at_the_truth(driven(replace(LONG, white_m=1e-9)))
    residual = fix_residuals(prepared, state)[prepared.fix_usable]
    np.testing.assert_allclose(residual, 0.0, atol=0.02)  # m: a yaw rate's mean against its end over 0.1 s

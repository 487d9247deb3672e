"""Which fixes get in: single jumps, stretches, car parks and coherent wrong clusters do not; good ones do, again."""

import numpy as np
import pytest

from driven_paths.examples import FRAME, Course, Driven, driven
from trigpoint_filtering.core.estimator import Belief, Estimator, GnssNoise
from trigpoint_filtering.core.gate import Fix, Hypothesis, in_outage, judged
from trigpoint_filtering.core.motion import Geometry
from trigpoint_filtering.core.rivalry import DEAF_REASON, USELESS_REASON
from trigpoint_filtering.core.track import FilteredDrive, filter_drive
from trigpoint_filtering.settings import FilterSettings

SETTINGS = FilterSettings()
NOISE = GnssNoise(1.0, 0.0, 100.0)
LIMIT = 5.991  # chi-square, 95 %, two degrees of freedom
SECOND_NS = 1_000_000_000


def filtered_of(run: Driven) -> FilteredDrive:
    return filter_drive(run.drive, FRAME, SETTINGS)


def accepted(filtered: FilteredDrive) -> np.ndarray:
    return np.array([verdict.accepted for verdict in filtered.judged])


def final_error_m(run: Driven, filtered: FilteredDrive) -> float:
    return float(np.hypot(*(filtered.pose - run.pose_at(filtered.stamp_ns))[-1, :2]))


def standing_hypothesis(sigma_m: float = 1.0, accepted_ns: int = 0) -> Hypothesis:
    mean = np.zeros(10)
    mean[3:5] = 1.0
    covariance = np.diag([sigma_m**2, sigma_m**2, 1e-4, 1e-6, 1e-6, 1e-8, 1e-8, 1e-8, 1e-8, 1e-8])
    return Hypothesis(Belief(mean, covariance), 0, accepted_ns)


def fix_at(x_m: float, stamp_s: float = 1.0) -> Fix:
    return Fix(round(stamp_s * SECOND_NS), np.array([x_m, 0.0]), NOISE)


ESTIMATOR = Estimator(Geometry(2.5, 0.0, 0.0, 0.0, 1.0))


@pytest.mark.parametrize(("x_m", "passes"), [(3.45, True), (3.47, False)])
def test_the_gate_stands_at_the_95_percent_quantile(x_m: float, passes: bool) -> None:
    # Position and fix of 1 m each: sqrt(2 * 5.991) = 3.461 m.
    _, verdict = judged(standing_hypothesis(), fix_at(x_m), ESTIMATOR, limit=LIMIT)
    assert verdict.accepted is passes


def test_nis_is_the_innovation_over_its_covariance() -> None:
    _, verdict = judged(standing_hypothesis(), fix_at(2.0), ESTIMATOR, limit=LIMIT)
    assert verdict.nis == pytest.approx(2.0, rel=1e-3)  # 2^2 / (1 + 1); the lever arm's tiny sigma is the rest


def test_a_rejected_fix_leaves_the_belief_untouched() -> None:
    before = standing_hypothesis()
    after, verdict = judged(before, fix_at(50.0), ESTIMATOR, limit=LIMIT)
    assert verdict.reason == "outside gate"
    assert after.belief is before.belief


def test_a_single_fix_does_not_end_an_outage() -> None:
    _, verdict = judged(standing_hypothesis(), fix_at(0.1, stamp_s=60.0), ESTIMATOR, limit=LIMIT)
    assert (verdict.accepted, verdict.reason) == (False, "outage")


def test_a_run_of_fixes_that_agree_ends_an_outage() -> None:
    hypothesis = standing_hypothesis()
    for second in range(60, 63):
        hypothesis, _ = judged(hypothesis, fix_at(0.1, stamp_s=second), ESTIMATOR, limit=LIMIT)
    _, verdict = judged(hypothesis, fix_at(0.1, stamp_s=63.0), ESTIMATOR, limit=LIMIT)
    assert (verdict.accepted, verdict.reason) == (True, "re-acquired")


def test_fixes_that_disagree_do_not_end_an_outage() -> None:
    hypothesis = standing_hypothesis(sigma_m=20.0)
    for second in range(60, 63):
        hypothesis, _ = judged(hypothesis, fix_at(30.0 * (-1) ** second, stamp_s=second), ESTIMATOR, limit=LIMIT)
    _, verdict = judged(hypothesis, fix_at(-30.0, stamp_s=63.0), ESTIMATOR, limit=LIMIT)
    assert not verdict.accepted


@pytest.mark.parametrize(("seconds", "passes"), [(20, False), (27, True)])
def test_a_gate_grown_wide_asks_for_a_run_longer_than_wrong_clusters(seconds: int, passes: bool) -> None:
    hypothesis = standing_hypothesis(sigma_m=300.0)
    for second in range(60, 60 + seconds):
        hypothesis, verdict = judged(hypothesis, fix_at(400.0, stamp_s=second), ESTIMATOR, limit=LIMIT)
        if verdict.accepted:
            break
    assert verdict.nis < LIMIT
    assert verdict.accepted is passes


def test_a_slow_receiver_is_not_in_an_outage_between_two_fixes() -> None:
    hypothesis = standing_hypothesis()
    for second in (0, 20, 40, 60):
        hypothesis, _ = judged(hypothesis, fix_at(0.0, stamp_s=second + 1.0), ESTIMATOR, limit=LIMIT)
    assert not in_outage(hypothesis, 81 * SECOND_NS)


def test_jumps_are_rejected_and_their_neighbours_are_not() -> None:
    run = driven(Course(duration_s=120.0))
    jumps = np.isin(run.fix_s(), [50.0, 70.0, 90.0])
    verdicts = accepted(filtered_of(run.with_shift(np.array([40.0, -25.0]), jumps)))
    assert not verdicts[jumps].any()
    # The gate turns away one good fix in twenty by design; a tenth leaves room for chance.
    assert verdicts[~jumps][30:].mean() > 0.9


def test_a_stretch_of_reflections_is_rejected_whole() -> None:
    run = driven(Course(duration_s=150.0))
    stretch = (run.fix_s() >= 80.0) & (run.fix_s() < 105.0)
    filtered = filtered_of(run.with_shift(np.array([15.0, 12.0]), stretch))
    assert not accepted(filtered)[stretch].any()
    assert accepted(filtered)[-30:].mean() > 0.8


def test_no_fix_of_a_car_park_is_accepted() -> None:
    run = driven(Course(duration_s=300.0))
    inside = (run.fix_s() >= 120.0) & (run.fix_s() < 210.0)
    rng = np.random.default_rng(7)
    distance_m, turn_rad = np.exp(rng.uniform(4.1, 8.3, inside.sum())), rng.uniform(0.0, 2.0 * np.pi, inside.sum())
    shift_m = distance_m[:, None] * np.column_stack([np.cos(turn_rad), np.sin(turn_rad)])
    filtered = filtered_of(run.with_shift(shift_m, inside))
    assert not accepted(filtered)[inside].any()
    assert accepted(filtered)[240:].mean() > 0.9


@pytest.mark.parametrize("turns_by", ["imu", "steering"])
def test_a_coherent_wrong_cluster_after_a_long_outage_does_not_capture(turns_by: str) -> None:
    run = driven(Course(duration_s=720.0, turns_by=turns_by))
    seconds = run.fix_s()
    cluster = (seconds >= 560.0) & (seconds < 580.0)
    run = run.with_shift(np.array([500.0, 490.0]), cluster).with_fixes((seconds < 100.0) | (seconds >= 560.0))
    filtered = filtered_of(run)
    assert not accepted(filtered)[100:120].any()
    assert accepted(filtered)[-60:].mean() > 0.9
    assert final_error_m(run, filtered) < 3.0  # m: dozens of good fixes of 1 m


def test_the_second_hypothesis_takes_over_from_a_false_start() -> None:
    run = driven(Course(duration_s=300.0))
    false_start = run.fix_s() < 40.0
    filtered = filtered_of(run.with_shift(np.array([300.0, 200.0]), false_start))
    assert accepted(filtered)[-60:].mean() > 0.9
    assert final_error_m(run, filtered) < 3.0


def test_a_wrong_cluster_that_lasts_is_left_again_for_the_truth() -> None:
    run = driven(Course(duration_s=420.0))
    lasting = (run.fix_s() >= 100.0) & (run.fix_s() < 270.0)
    filtered = filtered_of(run.with_shift(np.array([250.0, 0.0]), lasting))
    assert final_error_m(run, filtered) < 3.0
    assert accepted(filtered)[-30:].mean() > 0.9


def test_rejecting_everything_for_long_raises_one_alarm() -> None:
    run = driven(Course(duration_s=200.0))
    rng = np.random.default_rng(3)
    wild = run.fix_s() >= 60.0
    filtered = filtered_of(run.with_shift(rng.uniform(-3000.0, 3000.0, (int(wild.sum()), 2)), wild))
    assert [alarm.reason for alarm in filtered.alarms] == [DEAF_REASON]
    assert filtered.alarms[0].duration_s == pytest.approx(60.0, abs=3.0)  # s: the limit, and fixes once a second


def test_a_gate_that_could_reject_nothing_raises_an_alarm() -> None:
    run = driven(Course(duration_s=900.0, turns_by="steering"))
    filtered = filtered_of(run.with_fixes((run.fix_s() < 60.0) | (run.fix_s() > 860.0)))
    assert USELESS_REASON in {alarm.reason for alarm in filtered.alarms}

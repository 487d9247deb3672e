from dataclasses import replace

import numpy as np
import pytest

from evaluated_maps.examples import solved_example
from trigpoint.errors import InputError
from trigpoint.events.drives import first_stamp_ns
from trigpoint_evaluation.core.gnss import (
    FilteredPath,
    Withholding,
    evaluate_withheld,
    filter_errors_m,
    withheld_distances,
    withheld_fixes,
    withheld_mask,
    without_withheld,
)

HALF = Withholding(period_s=60.0, duration_s=30.0, offset_s=0.0)
OTHER_HALF = Withholding(period_s=60.0, duration_s=30.0, offset_s=30.0)


def test_a_fix_is_withheld_by_its_time_since_the_drive_began() -> None:
    since_s = np.array([0.0, 29.9, 30.0, 59.9, 60.0])
    mask = withheld_mask((1e9 * (100.0 + since_s)).astype(np.int64), 100_000_000_000, HALF)
    assert mask.tolist() == [True, True, False, False, True]


def test_two_offsets_withhold_every_fix_once() -> None:
    stamps = np.arange(0, 10**12, 10**8)
    assert np.all(withheld_mask(stamps, 0, HALF) ^ withheld_mask(stamps, 0, OTHER_HALF))


def test_what_is_withheld_is_what_the_solve_does_not_see() -> None:
    example = solved_example()
    drive = example.evaluated.drives[0]
    hidden = withheld_fixes(drive, HALF, example.evaluated.frame).stamp_ns
    seen = without_withheld(drive, HALF).fixes.stamp_ns
    assert sorted([*hidden, *seen]) == drive.fixes.stamp_ns.tolist()
    assert 0 < len(hidden) < len(drive.fixes.stamp_ns)


def test_a_withholding_that_leaves_nothing_is_refused_with_the_limit() -> None:
    with pytest.raises(InputError, match=r"duration 60.0 s is outside 0 to the period, 60.0 s"):
        Withholding(period_s=60.0, duration_s=60.0, offset_s=0.0)


def test_a_path_that_is_truth_is_as_far_from_the_fixes_as_they_are_wrong() -> None:
    example = solved_example()
    solved = {(one.vehicle, one.boot_id): one for one in example.evaluated.solved.trajectories}
    withheld = [withheld_fixes(drive, HALF, example.evaluated.frame) for drive in example.evaluated.drives]
    total, vehicles = evaluate_withheld(
        withheld_distances(withheld, solved=solved, solved_with_all=solved, filtered={})
    )
    assert [one.vehicle for one in vehicles] == ["vehicle-1", "vehicle-2"]
    assert total.path_difference_m.max == 0.0
    assert 2.0 < total.error_m.median < 6.0  # metres: 1.5 white and 2.5 slow an axis are 3.4 in the median


def test_a_drive_that_was_not_solved_is_withheld_and_has_no_error() -> None:
    example = solved_example()
    withheld = [withheld_fixes(example.evaluated.drives[0], HALF, example.evaluated.frame)]
    total, _ = evaluate_withheld(withheld_distances(withheld, solved={}, solved_with_all={}, filtered={}))
    assert (total.withheld > 0, total.error_m.count) == (True, 0)


def test_the_filter_is_measured_at_its_own_antenna() -> None:
    example = solved_example()
    drive = example.evaluated.drives[0]
    fixes = replace(
        withheld_fixes(drive, HALF, example.evaluated.frame),
        stamp_ns=np.array([first_stamp_ns(drive)]),
        point_m=np.array([[1.0, 2.0]]),
    )
    path = FilteredPath(
        vehicle=drive.vehicle,
        boot_id=drive.boot_id,
        stamp_ns=fixes.stamp_ns + np.array([0, 10**9]),
        pose=np.array([[0.0, 0.0, np.pi / 2.0], [0.0, 5.0, np.pi / 2.0]]),
        antenna_m=np.array([[2.0, -1.0], [9.0, 9.0]]),
    )
    np.testing.assert_allclose(filter_errors_m(path, fixes), [0.0], atol=1e-9)  # rounding, metres

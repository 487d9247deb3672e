"""Places known again: constellations propose where the base was, from any side, and points verify it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from scanned_worlds.casting import PERIOD_NS, SIXTEEN, START_NS, STREET, swept
from trigpoint.errors import EventRejected
from trigpoint.events.perceived import LandmarksPerceived, OdometryMatched, PerceivedLandmark
from trigpoint.geodesy.poses import transform_points
from trigpoint_perception.core.closures.clouds import Cloud, cloud_around, rows_around
from trigpoint_perception.core.closures.proposals import Proposal, proposals
from trigpoint_perception.core.closures.runs import Run, runs_of
from trigpoint_perception.core.closures.seeking import attempts
from trigpoint_perception.core.closures.settings import ClosureSettings
from trigpoint_perception.core.closures.submaps import submaps_of
from trigpoint_perception.core.closures.verification import verified
from trigpoint_perception.core.following import NumberedSweep
from trigpoint_perception.settings import PerceptionSettings

Floats = NDArray[np.float64]

SETTINGS = ClosureSettings()
SIGMA_M = 0.05  # of a sight
REACH_M = 30.0
STEP_M = 1.0


def things(seed: int, *, length_m: float = 200.0) -> Floats:
    """Poles (n, 2) to both sides of a street along the x axis, one every 5 m of it on average."""
    rng = np.random.default_rng(seed)
    count = int(length_m / 5.0)
    return np.column_stack(
        [rng.uniform(0.0, length_m, count), rng.choice([-8.0, 8.0], count) + rng.normal(0.0, 2.0, count)]
    )


def along(begin_m: float, end_m: float, *, aside_m: float) -> Floats:
    """Poses (n, 3) of a straight drive along the street, a sweep every metre."""
    x_m = np.linspace(begin_m, end_m, int(abs(end_m - begin_m) / STEP_M) + 1)
    heading_rad = np.full(len(x_m), 0.0 if end_m > begin_m else np.pi)
    return np.column_stack([x_m, np.full(len(x_m), aside_m), heading_rad])


def run_along(pose: Floats, thing_m: Floats, *, boot_id: str, seed: int = 3) -> Run:
    """A run by true motions along poses, on which every thing in reach is seen with some noise."""
    rng = np.random.default_rng(seed)
    start = np.array([*pose[0, :2], pose[0, 2]])
    c, s = np.cos(start[2]), np.sin(start[2])
    local_m = (pose[:, :2] - start[:2]) @ np.array([[c, -s], [s, c]])
    own_m = np.array([seen_from(each, thing_m) for each in pose])
    row, thing = np.nonzero(np.hypot(*own_m.transpose(2, 0, 1)) < REACH_M)
    return Run(
        vehicle="van",
        boot_id=boot_id,
        sensor="roof",
        sequence=np.arange(len(pose), dtype=np.int64),
        stamp_ns=START_NS + PERIOD_NS * np.arange(len(pose), dtype=np.int64),
        pose=np.column_stack([local_m, pose[:, 2] - start[2]]),
        path_m=STEP_M * np.arange(len(pose), dtype=np.float64),
        row=row,
        track=thing,
        kind=("pole",) * len(row),
        point_m=own_m[row, thing] + rng.normal(0.0, SIGMA_M, (len(row), 2)),
        covariance_m2=np.repeat(SIGMA_M**2 * np.eye(2)[None], len(row), axis=0),
    )


def seen_from(pose: Floats, point_m: Floats) -> Floats:
    """Points (n, 2) in the frame of a base at pose (3,)."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    seen: Floats = (point_m - pose[:2]) @ np.array([[c, -s], [s, c]])
    return seen


def proposed(one: Run, other: Run) -> list[Proposal]:
    """What one run's places propose among the other's that landmarks bear out."""
    ones, others = submaps_of([one], SETTINGS.submap), submaps_of([other], SETTINGS.submap)
    return [each for each in proposals(ones, [others], SETTINGS) if not each.refusal]


def off_m(found: Proposal, pose: Floats, other_pose: Floats) -> float:
    """How far a proposal is from where the base truly was, as seen from the other's."""
    true_m = seen_from(other_pose[found.other_row], pose[found.row][None, :2])[0]
    return float(np.hypot(*(found.T_other_one[:2] - true_m)))


@pytest.mark.parametrize(("begin_m", "end_m"), [(20.0, 180.0), (180.0, 20.0)])  # the same way, and back
def test_a_street_is_known_again_from_either_side(begin_m: float, end_m: float) -> None:
    first, again = along(20.0, 180.0, aside_m=-2.0), along(begin_m, end_m, aside_m=2.0)
    found = proposed(run_along(again, things(1), boot_id="b"), run_along(first, things(1), boot_id="a", seed=4))
    assert len(found) >= 8  # of 11 middles
    assert max(off_m(each, again, first) for each in found) < 0.2  # m: eight poles and more, 0.06 m in common each


def test_another_street_is_not_taken_for_this_one() -> None:
    pose = along(0.0, 200.0, aside_m=0.0)
    assert proposed(run_along(pose, things(1), boot_id="b"), run_along(pose, things(2), boot_id="a")) == []


def test_a_drives_own_neighbourhood_is_no_return() -> None:
    run = run_along(along(0.0, 90.0, aside_m=0.0), things(1), boot_id="a")
    submaps = submaps_of([run], SETTINGS.submap)
    assert list(proposals(submaps, [submaps], SETTINGS)) == []


def test_a_drive_that_comes_back_knows_its_own_way_out() -> None:
    pose = np.vstack([along(0.0, 160.0, aside_m=-2.0), along(160.0, 0.0, aside_m=2.0)])
    run = run_along(pose, things(1), boot_id="a")
    found = proposed(run, run)
    assert len(found) >= 2
    assert all(run.path_m[each.row] - run.path_m[each.other_row] >= SETTINGS.triangle.apart_m for each in found)


def motion(sequence: int, *, after: int) -> OdometryMatched:
    return OdometryMatched(
        vehicle="van",
        boot_id="a",
        sensor="roof",
        from_sequence=after,
        from_stamp_ns=START_NS + after,
        sweep_sequence=sequence,
        x_m=1.0,
        y_m=0.0,
        heading_rad=0.5 * np.pi,
        covariance=1e-4 * np.eye(3),
        matched_share=0.9,
    )


def test_a_sweep_that_was_not_matched_ends_a_run() -> None:
    motions = [motion(2, after=1), motion(3, after=2), motion(6, after=5)]
    runs = runs_of(motions, [START_NS + each.sweep_sequence for each in motions], [])
    assert [run.sequence.tolist() for run in runs] == [[1, 2, 3], [5, 6]]
    assert runs[0].pose[2] == pytest.approx((1.0, 1.0, -np.pi))  # ahead, then left; half a turn is minus pi


def test_what_was_seen_of_a_sweep_is_in_its_run() -> None:
    seen = PerceivedLandmark(
        kind="pole",
        landmark_class="trunk",
        track=7,
        x_m=3.0,
        y_m=1.0,
        variance_x_m2=0.01,
        covariance_xy_m2=0.001,
        variance_y_m2=0.02,
        height_m=3.0,
        diameter_m=0.3,
        points=20,
    )
    told = LandmarksPerceived(
        vehicle="van", boot_id="a", sensor="roof", sweep_sequence=2, refusal="", landmarks=(seen,)
    )
    (run,) = runs_of([motion(2, after=1)], [START_NS + 2], [told])
    assert (run.row.tolist(), run.track.tolist(), run.kind) == ([1], [7], ("pole",))
    assert run.covariance_m2.tolist() == [[[0.01, 0.001], [0.001, 0.02]]]


ROWS = 5
OUT = along(-2.0, 2.0, aside_m=-1.0)
BACK = along(3.0, -1.0, aside_m=1.5)
STREET_RUNS = {"out": OUT, "back": BACK}


@cache
def sweeps(name: str) -> tuple[NumberedSweep, ...]:
    """A sweep a metre along one of the street's runs, each taken standing."""
    rng = np.random.default_rng(len(name))
    return tuple(
        NumberedSweep(
            sequence=row, stamp_ns=START_NS + PERIOD_NS * row, scanned=swept(STREET, SIXTEEN, pose=pose, rng=rng)
        )
        for row, pose in enumerate(STREET_RUNS[name])
    )


@cache
def cloud(name: str, row: int = 2) -> Cloud:
    """The points around the middle of one of the street's runs."""
    run = run_along(STREET_RUNS[name], STREET.pole_m, boot_id=name)
    still = [
        replace(each, scanned=replace(each.scanned, offset_ns=0 * each.scanned.offset_ns)) for each in sweeps(name)
    ]
    chosen = [still[each] for each in rows_around(run, row, SETTINGS.verification)]
    return cloud_around(chosen, run, row, SETTINGS.verification, PerceptionSettings())


TRUE = np.array([*seen_from(OUT[2], BACK[2][None, :2])[0], np.pi])


def test_points_seen_from_the_other_side_lie_on_one_another() -> None:
    found = verified(cloud("back"), cloud("out"), TRUE + (0.2, -0.1, 0.01), SETTINGS.verification)
    assert found.refusal == ""
    error = found.T_other_one - TRUE
    error[2] = (error[2] + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(error) == pytest.approx(0.0, abs=0.03)  # m and rad: ranges are within 0.02 m
    assert error @ np.linalg.solve(found.covariance, error) < 16.3  # chi-square of 3 degrees of freedom, 99.9 %


@pytest.mark.parametrize("shift", [(5.0, 0.0, 0.0), (0.0, 4.0, 0.0), (0.0, 0.0, 0.5 * np.pi)])
def test_points_of_another_place_are_refused(shift: tuple[float, float, float]) -> None:
    found = verified(cloud("back"), cloud("out"), TRUE + shift, SETTINGS.verification)
    assert found.refusal != ""


def test_a_place_whose_points_cannot_be_used_is_refused_and_the_others_go_on() -> None:
    first, again = along(20.0, 180.0, aside_m=-2.0), along(20.0, 180.0, aside_m=2.0)
    ones = submaps_of([run_along(again, things(1), boot_id="b")], SETTINGS.submap)
    others = submaps_of([run_along(first, things(1), boot_id="a")], SETTINGS.submap)

    def unusable(run: Run, row: int) -> Cloud:
        raise EventRejected("empty sweep", "the sweep holds no point")

    found = list(attempts(ones, [others], unusable, SETTINGS))
    assert len(found) >= 8
    assert {each.refusal for each in found} == {"empty sweep"}


@pytest.mark.parametrize("left", [slice(0, 0), slice(2, 3), slice(3, None)])  # none, the middle alone, all but it
def test_points_that_were_retained_away_are_said_to_be_gone(left: slice) -> None:
    run = run_along(OUT, STREET.pole_m, boot_id="out")
    with pytest.raises(EventRejected, match="points gone"):
        cloud_around(sweeps("out")[left], run, 2, SETTINGS.verification, PerceptionSettings())


def test_the_sweeps_of_a_cloud_are_spread_about_its_middle() -> None:
    run = run_along(along(0.0, 60.0, aside_m=0.0), STREET.pole_m, boot_id="a")
    rows = rows_around(run, 30, SETTINGS.verification)
    assert rows.tolist() == sorted({*rows.tolist(), 30})
    assert (rows[0], rows[-1]) == (20, 40)  # m: half a span to either side
    assert len(rows) <= 2 * SETTINGS.verification.half_span_m / SETTINGS.verification.sweep_step_m + 1


def test_landmarks_stand_where_they_are_seen_from_the_middle() -> None:
    pose = along(20.0, 80.0, aside_m=0.0)
    (submap, *_) = submaps_of([run_along(pose, things(1), boot_id="a")], SETTINGS.submap)
    laid_m = transform_points(pose[submap.row], submap.landmarks.point_m)
    away_m = np.hypot(*(laid_m[:, None] - things(1)).transpose(2, 0, 1)).min(axis=1)
    assert away_m.max() < 0.1  # m: three sights of 0.05 m and more

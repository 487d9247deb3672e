"""Sweeps of a drive: deskewed, matched, tracked; what is wrong with one costs nothing of the others."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from scanned_worlds.casting import PERIOD_NS, SIXTEEN, SIXTY_FOUR, START_NS, STREET, World, driven_pose, swept
from trigpoint.errors import EventRejected
from trigpoint.events.perceived import LandmarksPerceived, OdometryMatched, SweepPerceived
from trigpoint.events.scanned import PointsScanned
from trigpoint_perception.core.deskew import deskewed, planar_path
from trigpoint_perception.core.following import NumberedSweep, SweepFollower
from trigpoint_perception.core.sharpness import sharpness_of
from trigpoint_perception.core.sweep import usable_sweep
from trigpoint_perception.settings import PerceptionSettings

SETTINGS = PerceptionSettings()
VELOCITY = (8.0, 0.3)  # m/s, rad/s


def drive(count: int, *, world: World = STREET) -> list[NumberedSweep]:
    """Sweeps ten a second of a base that drives a bend."""
    rng = np.random.default_rng(3)
    return [
        NumberedSweep(
            sequence=number,
            stamp_ns=START_NS + number * PERIOD_NS,
            scanned=swept(world, SIXTEEN, pose=driven_pose(VELOCITY, 0.1 * number), velocity=VELOCITY, rng=rng),
        )
        for number in range(count)
    ]


def told(sweeps: Sequence[NumberedSweep], **options: object) -> tuple[list[LandmarksPerceived], list[OdometryMatched]]:
    follower = SweepFollower("van", "boot-1", SETTINGS, **options)  # type: ignore[arg-type]
    events: list[SweepPerceived] = [event for sweep in sweeps for _, event in follower.take(sweep)]
    events += [event for _, event in follower.finished()]
    landmarks = [event for event in events if isinstance(event, LandmarksPerceived)]
    return landmarks, [event for event in events if isinstance(event, OdometryMatched)]


def changed(sweeps: Sequence[NumberedSweep], number: int, **fields: object) -> list[NumberedSweep]:
    """The sweeps with one whose points were changed."""
    scanned = replace(sweeps[number].scanned, **fields)  # type: ignore[arg-type]
    return [*sweeps[:number], replace(sweeps[number], scanned=scanned), *sweeps[number + 1 :]]


@pytest.fixture(scope="module")
def sweeps() -> list[NumberedSweep]:
    return drive(9)


def test_each_sweep_is_told_of_once_and_in_order(sweeps: list[NumberedSweep]) -> None:
    landmarks, motions = told(sweeps)
    assert [event.sweep_sequence for event in landmarks] == list(range(9))
    assert [(event.from_sequence, event.sweep_sequence) for event in motions] == [(n, n + 1) for n in range(8)]


def test_a_motion_is_what_was_driven_within_what_it_claims(sweeps: list[NumberedSweep]) -> None:
    _, motions = told(sweeps)
    expected = driven_pose(VELOCITY, 0.1)
    errors = np.array([[one.x_m, one.y_m, one.heading_rad] for one in motions])[2:] - expected
    claimed = np.array([one.covariance for one in motions])[2:]
    assert np.abs(errors[:, :2]).max() < 0.05  # of 0.8 m
    assert np.einsum("ij,ijk,ik->i", errors, np.linalg.inv(claimed), errors).max() < 16.3  # 3 degrees, 99.9 %


def stamped_at_begin(sweep: NumberedSweep) -> NumberedSweep:
    """The same points, told of with the time of the first instead of the middle one."""
    half_ns = PERIOD_NS // 2
    scanned = replace(sweep.scanned, offset_ns=sweep.scanned.offset_ns + np.int32(half_ns))
    return replace(sweep, stamp_ns=sweep.stamp_ns - half_ns, scanned=scanned)


def test_sweeps_stamped_at_their_begin_are_followed_without_wheels() -> None:
    _, motions = told([stamped_at_begin(sweep) for sweep in drive(16)])
    errors_m = np.array([[one.x_m, one.y_m] for one in motions]) - driven_pose(VELOCITY, 0.1)[:2]
    assert np.abs(errors_m).max() < 0.1  # of 0.8 m, the first ones too
    assert np.abs(errors_m[-5:]).max() < 0.02  # settled, not swinging to and fro


def test_a_thing_keeps_its_number(sweeps: list[NumberedSweep]) -> None:
    landmarks, _ = told(sweeps)
    assert len({(one.kind, one.track) for event in landmarks for one in event.landmarks}) <= 7  # 5 poles, 2 corners
    assert max(len(event.landmarks) for event in landmarks) >= 6


def test_what_is_seen_once_only_does_not_count(sweeps: list[NumberedSweep]) -> None:
    more = World(cylinders=np.vstack([STREET.cylinders, [[10.0, -1.5, 0.1, 5.0]]]), walls=STREET.walls)
    with_flash = [*sweeps[:4], drive(5, world=more)[4], *sweeps[5:]]
    landmarks, _ = told(with_flash)
    place_m = np.array([10.0, -1.5])
    pose = driven_pose(VELOCITY, 0.4)
    turn = np.array([[np.cos(pose[2]), np.sin(pose[2])], [-np.sin(pose[2]), np.cos(pose[2])]])
    there_m = turn @ (place_m - pose[:2])
    away_m = [np.hypot(one.x_m - there_m[0], one.y_m - there_m[1]) for one in landmarks[4].landmarks]
    assert min(away_m) > 1.0


def test_the_same_sweeps_give_the_same_events(sweeps: list[NumberedSweep]) -> None:
    first, second = told(sweeps)[0], told(sweeps)[0]
    assert [repr(event) for event in first] == [repr(event) for event in second]


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"point_m": np.zeros((0, 3), np.float32)}, "empty sweep"),
        ({"point_m": np.full((28800, 3), np.nan, np.float32)}, "no usable points: 0 of 28800"),
        ({"point_m": np.zeros((1_000_001, 3), np.float32)}, "huge sweep: 1000001 points, at most 1000000"),
        ({"sensor_orientation": np.zeros(4)}, "wrong extrinsics: the orientation's quaternion has length 0"),
        ({"sensor_position_m": np.array([0.0, 0.0, 150.0])}, "wrong extrinsics: the sensor is 150 m from the base"),
        ({"sensor_position_m": np.array([0.0, 0.0, -1.0])}, "wrong extrinsics: the sensor is -1 m above ground"),
        ({"sensor_position_m": np.array([np.nan, 0.0, 1.0])}, "wrong extrinsics"),
        ({"offset_ns": np.full(28800, 1_000_000_000, np.int32)}, "no path"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_bad_sweep_says_why_and_the_others_go_on(
    sweeps: list[NumberedSweep], fields: dict[str, object], reason: str
) -> None:
    landmarks, motions = told(changed(sweeps, 4, **fields))
    assert landmarks[4].refusal.startswith(reason)
    assert [event.refusal for event in landmarks[:4] + landmarks[5:]] == [""] * 8
    assert (3, 5) in {(one.from_sequence, one.sweep_sequence) for one in motions}
    assert len(landmarks[8].landmarks) >= 5


@pytest.mark.parametrize("jump_ns", [-3_600_000_000_000, 86_400_000_000_000], ids=["back", "ahead"])
def test_a_clock_jump_begins_anew_and_loses_no_sweep(sweeps: list[NumberedSweep], jump_ns: int) -> None:
    jumped = [*sweeps[:4], *(replace(sweep, stamp_ns=sweep.stamp_ns + jump_ns) for sweep in sweeps[4:])]
    landmarks, motions = told(jumped)
    assert [event.refusal for event in landmarks] == [""] * 9
    assert (3, 4) not in {(one.from_sequence, one.sweep_sequence) for one in motions}
    assert len(motions) == 7


def test_deskewed_points_lie_where_a_still_sensor_sees_them() -> None:
    moving: PointsScanned = swept(STREET, SIXTEEN, velocity=VELOCITY)
    sweep = usable_sweep(moving, SETTINGS.sweep)
    stamps = START_NS + np.arange(-2, 3, dtype=np.int64) * PERIOD_NS // 2
    poses = np.array([driven_pose(VELOCITY, 1e-9 * (int(stamp) - START_NS)) for stamp in stamps])
    still_m = deskewed(sweep.point_m, sweep.offset_ns, stamp_ns=START_NS, path=planar_path(stamps, poses))
    wall = STREET.walls[2]
    on_wall = np.abs(still_m[:, 1] - wall[1]) < 0.5
    on_wall &= (still_m[:, 0] > 10.0) & (still_m[:, 2] > 0.5)
    skewed_m, straight_m = (np.abs(points[on_wall, 1] - wall[1]).mean() for points in (sweep.point_m, still_m))
    assert straight_m < 0.03 < skewed_m  # 0.02 m of noise


def test_deskewed_points_make_a_sharper_map() -> None:
    slowly = (2.0, 0.1)  # the points of one wall stay neighbours: what is farther apart than 0.3 m is not compared
    sweep = usable_sweep(swept(STREET, SIXTY_FOUR, velocity=slowly, rng=np.random.default_rng(2)), SETTINGS.sweep)
    still = usable_sweep(swept(STREET, SIXTY_FOUR), SETTINGS.sweep)
    stamps = START_NS + np.arange(-2, 3, dtype=np.int64) * PERIOD_NS // 2
    poses = np.array([driven_pose(slowly, 1e-9 * (int(stamp) - START_NS)) for stamp in stamps])
    corrected = deskewed(sweep.point_m, sweep.offset_ns, stamp_ns=START_NS, path=planar_path(stamps, poses))
    upright = sweep.point_m[:, 2] > 0.4
    raw, sharp = (
        sharpness_of(np.concatenate([still.point_m, points[upright]]), points[upright][::20])
        for points in (sweep.point_m, corrected)
    )
    assert sharp.entropy < raw.entropy
    assert sharp.thickness_m < raw.thickness_m


def test_a_sweep_the_path_does_not_cover_is_refused_with_both_times() -> None:
    path = planar_path(np.array([0, 1_000_000_000]), np.zeros((2, 3)))
    with pytest.raises(EventRejected, match="5000000000 ns, and the path is known of 0 to 1000000000 ns"):
        deskewed(np.zeros((1, 3)), np.zeros(1, dtype=np.int64), stamp_ns=5_000_000_000, path=path)


def test_a_path_needs_two_poses() -> None:
    with pytest.raises(EventRejected, match="1 poses"):
        planar_path(np.array([0]), np.zeros((1, 3)))

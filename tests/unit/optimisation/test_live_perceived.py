"""What perception finds comes later than what was measured, and goes into the growing map as what a sensor detected."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from typing import cast

import numpy as np

from solved_worlds.examples import FRAME, Lap, World, world
from solved_worlds.logged import all_accepted, append_world, drive_rows
from solved_worlds.perceived import VARIANCE_M2, by_perception
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.mapped import LandmarkSolved, TrajectorySolved
from trigpoint.events.observed import LandmarksDetected, Observed, VehicleDescribed
from trigpoint.events.perceived import LandmarksPerceived
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.perceived_readings import PERCEIVED_STREAM
from trigpoint_optimisation.core.live_drive import PERCEIVED_WAIT_NS, LiveDrive
from trigpoint_optimisation.core.live_fleet import HUNG, PASSED_OVER, LiveFleet
from trigpoint_optimisation.core.live_leg import Leg
from trigpoint_optimisation.core.live_past import LATE_LEGS, PastLegs
from trigpoint_optimisation.core.odometry import DeadReckonedPath
from trigpoint_optimisation.live_perceived import PerceivedLandmarks
from trigpoint_optimisation.resuming import resumed
from trigpoint_optimisation.settings import SolveSettings

USUAL_NS = 700_000_000  # five sweeps and the work
MUCH_NS = PERCEIVED_WAIT_NS + 5_000_000_000  # more than legs wait
SETTINGS = SolveSettings()
STANDING = DeadReckonedPath(
    stamp_ns=np.zeros(1, dtype=np.int64),
    pose=np.zeros((1, 3)),
    distance_m=np.zeros(1),
    turned_rad=np.zeros(1),
    sampling_m2=np.zeros(1),
    sampling_rad2=np.zeros(1),
)


@cache
def lap() -> World:
    return world(Lap(duration_s=40.0))


@cache
def rows() -> tuple[Envelope[Observed], ...]:
    return tuple(cast(list[Envelope[Observed]], drive_rows(lap().drives[0])))


def is_sweep(row: Envelope[Observed]) -> bool:
    return isinstance(row.event, LandmarksDetected)


def drive() -> LiveDrive:
    return LiveDrive(lap().drives[0].described, "boot", SETTINGS, point_scale=1.0)


def with_perceived(late_ns: int) -> Iterator[Envelope[Observed]]:
    """Measurements in their order, each sweep so much later than what was measured with it."""
    due = sorted((row.stamp_ns + late_ns * is_sweep(row), row.identity.sequence, row) for row in rows())
    return (row for _, _, row in due)


def perceived(row: Envelope[Observed]) -> Envelope[LandmarksPerceived]:
    """Perception's word of a sweep."""
    return by_perception(row, lap().drives[0].described, row.identity.sequence)


def legs_of(follower: LiveDrive, late_ns: int) -> list[Leg]:
    """The legs of a drive in whose sweeps perception found so late what is in them."""
    legs = []
    for row in with_perceived(late_ns):
        legs += follower.perceive(perceived(row)) if is_sweep(row) else follower.take(row)
    return legs


def seen_in(legs: Sequence[Leg]) -> dict[int, list[tuple[int, int]]]:
    """By keyframe the track and number of detections of all that was seen from it."""
    return {
        leg.keyframe: [
            (track.number, sum(seen.keyframe == leg.keyframe for seen in track.seen)) for track in leg.tracks.values()
        ]
        for leg in legs
    }


def sightings(seen: list[tuple[int, int]]) -> list[int]:
    return sorted(count for _, count in seen)


def test_a_leg_waits_for_what_is_perceived_in_its_sweeps() -> None:
    plain, follower = drive(), drive()
    in_order = seen_in([leg for row in rows() for leg in plain.take(row)])
    late = seen_in(legs_of(follower, USUAL_NS))
    first = min(keyframe for keyframe, seen in late.items() if seen) + 1  # nothing waits before the first is here
    both = [keyframe for keyframe in late if keyframe > first]
    assert len(both) > 20
    assert follower.passed_over <= 1 + USUAL_NS // 100_000_000
    assert [sightings(late[keyframe]) for keyframe in both] == [sightings(in_order[keyframe]) for keyframe in both]


def test_what_comes_after_its_leg_was_whole_is_hung_on_it() -> None:
    plain, follower = drive(), drive()
    in_order = [leg for row in rows() for leg in plain.take(row)]
    legs = legs_of(follower, MUCH_NS)
    assert follower.passed_over == 0
    assert {keyframe: sightings(seen) for keyframe, seen in seen_in(legs).items()} == {
        keyframe: sightings(seen) for keyframe, seen in seen_in(in_order[: len(legs)]).items()
    }


def test_a_leg_of_which_more_was_seen_is_told_of_once_with_its_sweeps() -> None:
    follower = drive()
    legs = legs_of(follower, MUCH_NS)
    late = follower.seen_late()
    assert [one.leg.keyframe for one in late] == [leg.keyframe for leg in legs if leg.tracks][: len(late)]
    assert sum(one.sweeps for one in late) >= sum(map(is_sweep, rows())) - 6  # those of the last legs
    assert not follower.seen_late()


def test_what_belongs_to_legs_that_are_forgotten_is_passed_over() -> None:
    past, first = PastLegs(), next(iter(legs_of(drive(), USUAL_NS)))
    length_ns = first.end_ns - first.start_ns
    for number in range(LATE_LEGS + 1):
        start_ns = first.start_ns + number * length_ns
        past.add(replace(first, start_ns=start_ns, end_ns=start_ns + length_ns), STANDING)
    assert past.at(first.start_ns) is None
    assert past.at(first.end_ns) is not None


def test_what_the_vehicle_itself_detected_is_not_seen_again_by_perception() -> None:
    follower = drive()
    for row in rows():
        follower.take(row)
    sweeps = [row for row in rows() if is_sweep(row)]
    for row in sweeps:
        follower.perceive(perceived(row))
    assert follower.passed_over == len(sweeps)


def test_what_is_ahead_of_all_measurements_is_kept_up_to_a_bound() -> None:
    follower = drive()
    follower.take(rows()[0])
    sweep = next(row for row in rows() if is_sweep(row))
    for number in range(1000):
        identity = EventIdentity("car", "boot", 10_000 + number)
        follower.perceive(Envelope(identity, sweep.stamp_ns + 3_600_000_000_000 + number, perceived(sweep).event))
    assert (follower.ahead, follower.passed_over) == (0, 500)


def late_map(late_ns: int) -> LiveFleet:
    """The drive taken as it is driven, what was perceived so much later, and all that waits looked at."""
    fleet = LiveFleet(FRAME, SETTINGS)
    for verdict in all_accepted(rows()):
        fleet.judged(verdict)
    for row in with_perceived(late_ns):
        if is_sweep(row):
            fleet.perceive(perceived(row))
        else:
            fleet.take(row)
    while fleet.catch_up()[0]:
        pass
    return fleet


@cache
def mapped(late_ns: int) -> dict[str, LandmarkSolved]:
    return {one.landmark: one for one in late_map(late_ns).map.changed_landmarks(share=0.1)}


def test_a_map_of_what_was_perceived_late_is_that_of_what_was_in_time() -> None:
    late, in_time = mapped(MUCH_NS), mapped(USUAL_NS)
    both = late.keys() & in_time.keys()
    assert len(both) > 0.8 * len(in_time) > 8
    off = [np.hypot(*(late[name].position_m - in_time[name].position_m)) for name in both]
    sigma_m = [math.sqrt(0.5 * np.trace(in_time[name].covariance_m2)) for name in both]
    assert np.median(np.divide(off, sigma_m)) < 1.0  # calibration is learned without them, and the path is another


def test_the_same_events_give_the_same_map_to_the_last_digit_however_late() -> None:
    again = {one.landmark: one for one in late_map(MUCH_NS).map.changed_landmarks(share=0.1)}
    ours, theirs = (
        {name: (one.position_m.tolist(), one.covariance_m2.tolist()) for name, one in each.items()}
        for each in (mapped(MUCH_NS), again)
    )
    assert ours == theirs


def test_late_sweeps_are_counted_by_what_became_of_them() -> None:
    fleet = late_map(MUCH_NS)
    late = fleet.take_late()
    assert late["car", HUNG] > 60
    assert ("car", PASSED_OVER) not in late
    assert not fleet.take_late()


def test_what_is_of_legs_before_the_map_began_anew_waits_for_the_next_whole_solve() -> None:
    fleet, due = LiveFleet(FRAME, SETTINGS), list(with_perceived(MUCH_NS))
    for row in due:
        if not is_sweep(row):
            fleet.take(row)
    fleet.begin_anew((), [path_until(due[-1].stamp_ns)], excluded=())
    while fleet.catch_up()[0]:
        pass
    for row in due:
        if is_sweep(row):
            fleet.perceive(perceived(row))
    assert fleet.take_late()["car", PASSED_OVER] > 60


def path_until(stamp_ns: int) -> TrajectorySolved:
    """A whole solve's path of the drive up to a stamp."""
    return TrajectorySolved(
        map_version=1,
        vehicle="car",
        boot_id="boot",
        stamp_ns=np.array([stamp_ns]),
        pose=np.zeros((1, 3)),
        covariance=np.eye(3)[None],
        calibration=(),
    )


def test_a_growing_landmark_is_no_surer_than_what_its_sights_share() -> None:
    shared_m2 = SETTINGS.detections.shared_share * VARIANCE_M2
    for one in mapped(USUAL_NS).values():
        assert np.linalg.eigvalsh(one.covariance_m2)[0] > shared_m2


def perceived_rows(boot_id: str = "perceived") -> list[Envelope[Event]]:
    described = lap().drives[0].described
    some = [by_perception(cast(Envelope[Event], row), described, 0) for row in rows() if is_sweep(row)]
    return [
        Envelope(EventIdentity("perception", boot_id, number), row.stamp_ns, row.event)
        for number, row in enumerate(some)
    ]


def fleet_log(*boots: str) -> MemoryLog:
    """The drive without a detection of its own, and what perception said of it, once for each of its boots."""
    log = MemoryLog()
    append_world(log, lap())
    bare = MemoryLog()
    for stream in log.streams():
        kept = [row.envelope for row in log.read(stream) if not isinstance(row.envelope.event, LandmarksDetected)]
        bare.append(stream, kept)
    for boot_id in boots:
        bare.append(PERCEIVED_STREAM, perceived_rows(boot_id))
    return bare


def grown(log: MemoryLog) -> list[LandmarkSolved]:
    """The landmarks of a map grown from a log, by measurements and what was perceived, some of each at a time."""
    fleet, perceived = LiveFleet(FRAME, SETTINGS), PerceivedLandmarks(log, first_number=0)
    measured = [cast(Envelope[Observed], row.envelope) for row in log.read("veh-car")]
    for first in range(0, len(measured), 500):
        perceived.take(fleet, measurements_wait=True)
        for row in measured[first : first + 500]:
            fleet.take(row)
            perceived.begun(fleet)
        for verdict in all_accepted(measured[first : first + 500]):
            fleet.judged(verdict)
    while fleet.catch_up()[0]:
        pass
    return fleet.map.changed_landmarks(share=0.1)


def test_a_map_grows_from_what_was_perceived() -> None:
    off = [np.hypot(*(lap().pole_m - one.position_m).T).min() for one in grown(fleet_log("one"))]
    assert len(off) > 10
    assert np.median(off) < 3.0  # the error of the fixes, common to all


def test_what_was_perceived_by_other_settings_counts_once() -> None:
    once, twice = (grown(fleet_log(*boots)) for boots in (("one",), ("one", "two")))
    assert [one.observations for one in once] == [one.observations for one in twice]


def test_after_a_restart_it_is_read_from_where_the_newest_boot_began() -> None:
    log, later_ns = fleet_log("one"), 10**13
    described = VehicleDescribed(vehicle="car")
    log.append("veh-car", [Envelope(EventIdentity("car", "boot-2", 0), rows()[-1].stamp_ns + later_ns, described)])
    before = log.next_number(PERCEIVED_STREAM)
    assert resumed(log).perceived_number == before
    found = LandmarksPerceived(
        vehicle="car", boot_id="boot-2", sensor="roof", sweep_sequence=1, refusal="", landmarks=()
    )
    row = Envelope(EventIdentity("perception", "boot-2", 0), rows()[-1].stamp_ns + later_ns + 1, found)
    log.append(PERCEIVED_STREAM, [cast(Envelope[Event], row)])
    assert resumed(log).perceived_number == before

"""What perception says later than legs wait for it is hung on the legs it belongs to, in a map that has them."""

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from functools import cache
from typing import Any, cast

import numpy as np

from solved_worlds.examples import FRAME
from solved_worlds.logged import all_accepted, append_world
from solved_worlds.perceived import VARIANCE_M2
from solved_worlds.perceived_lap import (
    SETTINGS,
    USUAL_NS,
    drive,
    is_sweep,
    lap,
    legs_of,
    perceived,
    rows,
    seen_in,
    sightings,
    with_perceived,
)
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.mapped import LandmarkSolved, MapSolved, TrajectorySolved
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.perceived_readings import PERCEIVED_STREAM
from trigpoint.logs.readings import logged_maps
from trigpoint.observability.metrics import Instruments
from trigpoint_optimisation.core.live_drive import PERCEIVED_WAIT_NS
from trigpoint_optimisation.core.live_fleet import HUNG, PASSED_OVER, LiveFleet
from trigpoint_optimisation.core.live_past import LATE_LEGS, PastLegs
from trigpoint_optimisation.core.odometry import DeadReckonedPath
from trigpoint_optimisation.live import LiveOptimisation
from trigpoint_optimisation.settings import LiveSettings, SolveSettings
from trigpoint_optimisation.whole_solve import SolverInPlace

NEVER_S = 1e9
EAGER = SolveSettings(live=LiveSettings(version_interval_s=0.0, settle_s=NEVER_S, solve_interval_s=NEVER_S))
MUCH_NS = PERCEIVED_WAIT_NS + 5_000_000_000  # more than legs wait
STANDING = DeadReckonedPath(
    stamp_ns=np.zeros(1, dtype=np.int64),
    pose=np.zeros((1, 3)),
    distance_m=np.zeros(1),
    turned_rad=np.zeros(1),
    sampling_m2=np.zeros(1),
    sampling_rad2=np.zeros(1),
)


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
    off_m = np.array([late[name].position_m - in_time[name].position_m for name in both])
    assert np.hypot(*off_m.mean(axis=0)) < 1.0  # where fixes of metres hold the whole of it
    shape_m = np.hypot(*(off_m - off_m.mean(axis=0)).T)
    assert np.median(shape_m) < 0.3  # odometry is not calibrated by late sights: a percent or two over 40 m


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


def service(log: MemoryLog, instruments: Instruments) -> LiveOptimisation:
    return LiveOptimisation(log, SolverInPlace(log, EAGER), settings=EAGER, instruments=instruments)


def taken_in(log: MemoryLog, rows_of: Mapping[str, Sequence[Envelope[Any]]]) -> float:
    """These rows appended to their streams, one stream after the other, and each taken in by a service that ends then;
    how many sweeps it hung late."""
    instruments = Instruments("optimisation")
    with closing(service(log, instruments)) as one:
        for stream, some in rows_of.items():
            log.append(stream, list(some))
            while one.step():
                pass
    labels = {"vehicle": "car", "outcome": HUNG}
    return instruments.registry.get_sample_value("trigpoint_late_sweeps_total", labels) or 0.0


def test_after_a_restart_late_sweeps_still_find_their_legs_and_no_event_is_said_twice() -> None:
    log, measured = begun_log(), [row for row in rows() if not is_sweep(row)]
    sweeps = [numbered(perceived(row), number) for number, row in enumerate(row for row in rows() if is_sweep(row))]
    half, third = len(measured) // 2, len(sweeps) // 3
    first = taken_in(log, {"veh-car": measured[:half], PERCEIVED_STREAM: sweeps[:third]})
    second = taken_in(log, {"veh-car": measured[half:], PERCEIVED_STREAM: sweeps[third:]})
    assert min(first, second) > 10
    corrections = [row.envelope.stamp_ns for row in log.read("odometry")]
    assert corrections == sorted(set(corrections))
    heads = [cast(MapSolved, row.envelope.event) for row in log.read("optimisation", kinds=(MapSolved,))]
    assert [head.base_version for head in heads] == list(range(len(heads)))
    off = [np.hypot(*(lap().pole_m - one.position_m).T).min() for one in logged_maps(log)[-1].landmarks]
    assert len(off) > 15
    assert np.median(off) < 3.0  # the error of the fixes, common to all


def numbered(row: Envelope[Any], number: int) -> Envelope[Any]:
    return replace(row, identity=EventIdentity("perception", "perceived", number))


def begun_log() -> MemoryLog:
    """The frame, and the filter's word that every fix holds."""
    log, whole = MemoryLog(), MemoryLog()
    append_world(whole, lap())
    log.append("map", [row.envelope for row in whole.read("map")])
    verdicts = [Envelope(EventIdentity("filtering", "car", n), 0, one) for n, one in enumerate(all_accepted(rows()))]
    log.append("filtering", [*verdicts])
    return log

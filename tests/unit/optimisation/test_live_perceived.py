"""What perception finds comes later than what was measured, and goes into the growing map as what a sensor detected."""

from typing import cast

import numpy as np

from solved_worlds.examples import FRAME
from solved_worlds.logged import all_accepted, append_world
from solved_worlds.perceived import by_perception
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
)
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.mapped import LandmarkSolved
from trigpoint.events.observed import LandmarksDetected, Observed, VehicleDescribed
from trigpoint.events.perceived import LandmarksPerceived
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.perceived_readings import PERCEIVED_STREAM
from trigpoint_optimisation.core.live_fleet import LiveFleet
from trigpoint_optimisation.live_perceived import PerceivedLandmarks
from trigpoint_optimisation.resuming import resumed


def test_a_leg_waits_for_what_is_perceived_in_its_sweeps() -> None:
    plain, follower = drive(), drive()
    in_order = seen_in([leg for row in rows() for leg in plain.take(row)])
    late = seen_in(legs_of(follower, USUAL_NS))
    first = min(keyframe for keyframe, seen in late.items() if seen) + 1  # nothing waits before the first is here
    both = [keyframe for keyframe in late if keyframe > first]
    assert len(both) > 20
    assert follower.passed_over <= 1 + USUAL_NS // 100_000_000
    assert [sightings(late[keyframe]) for keyframe in both] == [sightings(in_order[keyframe]) for keyframe in both]


def test_what_is_ahead_of_all_measurements_is_kept_up_to_a_bound() -> None:
    follower = drive()
    follower.take(rows()[0])
    sweep = next(row for row in rows() if is_sweep(row))
    for number in range(1000):
        identity = EventIdentity("car", "boot", 10_000 + number)
        follower.perceive(Envelope(identity, sweep.stamp_ns + 3_600_000_000_000 + number, perceived(sweep).event))
    assert (follower.ahead, follower.passed_over) == (0, 500)


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
    fleet, follower = LiveFleet(FRAME, SETTINGS), PerceivedLandmarks(log, first_number=0)
    measured = [cast(Envelope[Observed], row.envelope) for row in log.read("veh-car")]
    for first in range(0, len(measured), 500):
        follower.take(fleet, measurements_wait=True)
        for row in measured[first : first + 500]:
            fleet.take(row)
            follower.begun(fleet)
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

"""A short lap and what perception says of its sweeps, in time or late."""

from collections.abc import Iterator, Sequence
from functools import cache
from typing import cast

from solved_worlds.examples import Lap, World, world
from solved_worlds.logged import drive_rows
from solved_worlds.perceived import by_perception
from trigpoint.events.envelope import Envelope
from trigpoint.events.observed import LandmarksDetected, Observed
from trigpoint.events.perceived import LandmarksPerceived
from trigpoint_optimisation.core.live_drive import LiveDrive
from trigpoint_optimisation.core.live_leg import Leg
from trigpoint_optimisation.settings import SolveSettings

USUAL_NS = 700_000_000  # five sweeps and the work
SETTINGS = SolveSettings()


@cache
def lap() -> World:
    """One car, 40 s."""
    return world(Lap(duration_s=40.0))


@cache
def rows() -> tuple[Envelope[Observed], ...]:
    """What the car measured and detected."""
    return tuple(cast(list[Envelope[Observed]], drive_rows(lap().drives[0])))


def is_sweep(row: Envelope[Observed]) -> bool:
    """Whether it is a sweep of the landmark sensor."""
    return isinstance(row.event, LandmarksDetected)


def with_perceived(late_ns: int) -> Iterator[Envelope[Observed]]:
    """Measurements in their order, each sweep so much later than what was measured with it."""
    due = sorted((row.stamp_ns + late_ns * is_sweep(row), row.identity.sequence, row) for row in rows())
    return (row for _, _, row in due)


def perceived(row: Envelope[Observed]) -> Envelope[LandmarksPerceived]:
    """Perception's word of a sweep."""
    return by_perception(row, lap().drives[0].described, row.identity.sequence)


def drive() -> LiveDrive:
    """The car followed from its beginning."""
    return LiveDrive(lap().drives[0].described, "boot", SETTINGS, point_scale=1.0)


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
    """How often each track was seen, whatever its number."""
    return sorted(count for _, count in seen)

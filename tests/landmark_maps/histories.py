"""Logs of many map versions: whole ones, and between them versions that say only what changed."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from landmark_maps.examples import MAP_STREAM, START_NS, closing, pin_frame, solved_landmark
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.mapped import LandmarkSolved, Mapped
from trigpoint.logs.ports import EventLog

SPACING_M = 2.0
ROW_COUNT = 200  # landmarks a row of the grid they stand on
STEP_M = 0.001  # by which a landmark moves from one version to the next that names it
WHOLE_EVERY = 25  # versions
WRITER = "trigpoint_optimisation"


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """A map of `landmark_count`; `changed_count` of them move with each version, and one comes or goes."""

    landmark_count: int
    changed_count: int
    event_count: int


def append_history(log: EventLog, history: History) -> None:
    """The versions of a history, at least so many events, after the frame they are in."""
    pin_frame(log)
    number = 0
    for events in _versions(history):
        rows = [
            Envelope(EventIdentity(WRITER, "boot-1", number + index), START_NS + number + index, event)
            for index, event in enumerate(events)
        ]
        log.append(MAP_STREAM, rows)
        number += len(rows)
        if number >= history.event_count:
            return


def _versions(history: History) -> Iterator[list[Mapped]]:
    at = {f"L{n}": solved_landmark(f"L{n}", *_place(n)) for n in range(history.landmark_count)}
    names, version = list(at), 0
    while True:
        version += 1
        first = version * history.changed_count
        changed = [names[(first + index) % len(names)] for index in range(history.changed_count)]
        removed = () if version % 2 or changed[-1] not in at else (changed.pop(),)
        for name in changed:
            at[name] = _moved(at.get(name) or solved_landmark(name, *_place(int(name[1:]))), version)
        for name in removed:
            at.pop(name, None)
        if version % WHOLE_EVERY == 1:
            yield [*(replace(row, map_version=version) for row in at.values()), closing(version, len(at))]
        else:
            head = replace(closing(version, len(at)), base_version=version - 1, removed=removed)
            yield [*(at[name] for name in changed), head]


def _place(number: int) -> tuple[float, float]:
    return SPACING_M * (number % ROW_COUNT), SPACING_M * (number // ROW_COUNT)


def _moved(row: LandmarkSolved, version: int) -> LandmarkSolved:
    return replace(row, map_version=version, position_m=row.position_m + STEP_M)

"""Optimisation at work on a log: what it holds is solved and appended as the next map version."""

import logging
import time
from collections.abc import Iterable
from dataclasses import replace
from hashlib import blake2b

from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.mapped import Mapped, MapSolved
from trigpoint.logs.perceived_readings import PERCEIVED_STREAM
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import (
    FRAME_STREAM,
    LABEL_STREAM,
    VERDICT_STREAM,
    logged_anchors,
    logged_drives,
    logged_frame,
    logged_verdicts,
    vehicle_streams,
)
from trigpoint_optimisation.core.fleet import Progress
from trigpoint_optimisation.core.solve import Solution, solve_map
from trigpoint_optimisation.core.stages import in_silence
from trigpoint_optimisation.settings import SolveSettings, settings_json

logger = logging.getLogger(__name__)

SOURCE = "optimisation"
STREAM = STREAM_PATTERNS[MapSolved]


def input_positions(log: EventLog) -> tuple[tuple[str, int], ...]:
    """How many events of each stream a solve of the log as it stands is made from."""
    perceived = (PERCEIVED_STREAM,) if log.next_number(PERCEIVED_STREAM) else ()
    streams = (*vehicle_streams(log), FRAME_STREAM, LABEL_STREAM, VERDICT_STREAM, *perceived)
    return tuple((stream, log.next_number(stream)) for stream in streams)


def newest_version(log: EventLog) -> int:
    """The number of the newest map version, 0 where there is none."""
    rows = log.read(STREAM, kinds=(MapSolved,))
    versions = (row.envelope.event.map_version for row in rows if isinstance(row.envelope.event, MapSolved))
    return max(versions, default=0)


def build(log: EventLog, settings: SolveSettings, *, progress: Progress = in_silence) -> Solution:
    """The next map version solved from everything the log holds, and appended with its number and inputs.

    Raises InputError where the log has no drives or frame, AlignmentRefused where they fix no map, AppendFailed.
    """
    inputs, begun_s = input_positions(log), time.monotonic()
    solution = solve_map(
        logged_drives(log),
        logged_anchors(log),
        logged_frame(log),
        settings,
        verdicts=logged_verdicts(log),
        progress=progress,
    )
    for left_out in solution.left_out:
        logger.warning("%s", left_out)
    events = solution.map.events()
    version = newest_version(log) + 1
    head = replace(solution.map.head, inputs=inputs, wall_s=time.monotonic() - begun_s)
    numbered = tuple(replace(event, map_version=version) for event in (*events[:-1], head))
    log.append(
        STREAM, envelopes(numbered, boot_id=boot_id_of(version, inputs, settings), stamp_ns=last_seen_ns(solution))
    )
    return solution


def last_seen_ns(solution: Solution) -> int:
    """The newest measurement in the map: a version's stamp, so that no clock is in the log."""
    return max((int(path.stamp_ns[-1]) for path in solution.map.trajectories), default=0)


def boot_id_of(version: int, inputs: tuple[tuple[str, int], ...], settings: SolveSettings) -> str:
    """The boot under which the events of a version are numbered."""
    text = f"{version}/{inputs}/{settings_json(settings)}"
    return blake2b(text.encode(), digest_size=8).hexdigest()


def envelopes(
    events: Iterable[Mapped], *, boot_id: str, stamp_ns: int, first_sequence: int = 0
) -> list[Envelope[Event]]:
    """The events of a version, or a part of them, numbered."""
    return [
        Envelope(EventIdentity(SOURCE, boot_id, sequence), stamp_ns, event)
        for sequence, event in enumerate(events, start=first_sequence)
    ]

"""A log of one drive that reads as one of many vehicles: each drove the same way, a lane farther north."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np

from raster_peers.datashader_race import POINTS, turn
from scanned_drives.examples import POSE_NS, START_NS, SWEEP_NS, Floats, map_rows, pinned, solved_path
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity, LogPosition
from trigpoint.events.runs import EncodedRun
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.ports import LoggedEvent, RecallingLog

VEHICLE, STREAM, PREFIX = "recorded", "veh-recorded", "veh-"
SWEEPS = 694  # just under 20 million points
SPEED_MPS, WAVE_M, WAVE_RAD = 10.0, 200.0, 0.3  # a street that winds
LANE_M = 20.0  # what is within 35 m of a lane is seen from three or four
TOGETHER = 50  # sweeps appended at once


def record_drive(folder: Path, sweeps: int = SWEEPS) -> None:
    """A log of one drive's sweeps, some 28,800 points each."""
    log, random = McapLog(folder), np.random.default_rng(1)
    for first in range(0, sweeps, TOGETHER):
        numbers = range(first, min(first + TOGETHER, sweeps))
        log.append(STREAM, [_row(number, random) for number in numbers])
    log.close()


def _row(number: int, random: np.random.Generator) -> Envelope[Event]:
    return Envelope(EventIdentity(VEHICLE, "b", number), START_NS + SWEEP_NS * number, turn(random))


def points_of(drives: int, sweeps: int = SWEEPS) -> int:
    """How many points a fleet's log holds."""
    return drives * sweeps * POINTS


@dataclass(frozen=True, slots=True)
class ReplayedLog:
    """Reads the recorded drive as that of each vehicle, decoding it anew for each, and a map version: what rendering
    asks of a RecallingLog."""

    recorded: McapLog
    mapped: MemoryLog
    drives: int

    def streams(self) -> tuple[str, ...]:
        """The vehicles', and those of the map version."""
        return (*self.mapped.streams(), *(f"{PREFIX}{_vehicle(number)}" for number in range(self.drives)))

    def read(
        self,
        stream: str,
        *,
        first_number: int = 0,
        from_ns: int | None = None,
        until_ns: int | None = None,
        kinds: Sequence[type] | None = None,
    ) -> Iterator[LoggedEvent]:
        """As the log it stands for."""
        if not stream.startswith(PREFIX):
            yield from self.mapped.read(stream, first_number=first_number, kinds=kinds)
            return
        vehicle = stream.removeprefix(PREFIX)
        for row in self.recorded.read(
            STREAM, first_number=first_number, from_ns=from_ns, until_ns=until_ns, kinds=kinds
        ):
            known = row.envelope
            envelope = Envelope(replace(known.identity, source=vehicle), known.stamp_ns, known.event)
            yield LoggedEvent(LogPosition(stream, row.position.number), envelope)

    def read_headers(self, stream: str) -> Iterator[EncodedRun]:
        """As the log it stands for."""
        for run in self.recorded.read_headers(STREAM):
            yield replace(run, source=stream.removeprefix(PREFIX))


@contextmanager
def replayed_log(folder: Path, drives: int, sweeps: int = SWEEPS) -> Iterator[RecallingLog]:
    """The drive recorded in a folder as that of so many vehicles."""
    recorded, mapped = McapLog(folder), MemoryLog()
    mapped.append("map", [pinned()])
    paths = [solved_path(_vehicle(number), _way(number, sweeps)) for number in range(drives)]
    mapped.append("optimisation", map_rows(paths))
    try:
        yield cast(RecallingLog, ReplayedLog(recorded, mapped, drives))
    finally:
        recorded.close()


def _vehicle(number: int) -> str:
    return f"v{number:05d}"


def _way(number: int, sweeps: int) -> Floats:
    """Poses (n, 3) of a vehicle, some longer than its sweeps."""
    along_m = SPEED_MPS * POSE_NS * 1e-9 * np.arange(sweeps + 2)
    heading = WAVE_RAD * np.sin(along_m / WAVE_M)
    step_m = np.diff(along_m, prepend=0.0)
    x_m, y_m = np.cumsum(step_m * np.cos(heading)), np.cumsum(step_m * np.sin(heading))
    return np.column_stack([x_m, y_m + number * LANE_M, heading])

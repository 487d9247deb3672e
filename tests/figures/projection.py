"""A million events projected into PostGIS by the process an operator runs: how fast, and in how much memory."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from statistics import median

from figures.figure import Bounds, Figure, Measurement, at_least, at_most
from figures.workbench import CommandFailed, Workbench
from landmark_databases.cluster import binaries, running_cluster
from landmark_databases.served import projecting, taken_in, wait_until
from landmark_maps.examples import MAP_STREAM
from landmark_maps.histories import History, append_history
from trigpoint.logs.mcap_log import McapLog
from trigpoint_landmarks.settings import LandmarkSettings

HISTORY = History(landmark_count=20_000, changed_count=2_000, event_count=1_000_000)
BATCH_EVENTS = LandmarkSettings().batch_events
LIMIT_S = 900.0
COMMAND = (
    f"trigpoint serve landmarks  # {HISTORY.event_count} events: a map of {HISTORY.landmark_count} landmarks, "
    f"{HISTORY.changed_count} changed a version, every 25th version whole; from its start until it is ready"
)


@dataclass(slots=True)
class Projected:
    """What was seen of a projection: events, duration, and resident memory at every look."""

    events: int = 0
    wall_s: float = 0.0
    resident_mb: list[float] = field(default_factory=list)

    @property
    def memory_growth(self) -> float:
        """Resident memory in the last quarter of the time over that in the second quarter."""
        quarter = max(1, len(self.resident_mb) // 4)
        return median(self.resident_mb[-quarter:]) / median(self.resident_mb[quarter : 2 * quarter] or [1.0])


def resident_mb(pid: int) -> float:
    """The resident memory of a process; 0 for one that is gone."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return 0.0
    return pages * 4096 / 1e6


@cache
def projected(folder: Path) -> Projected:
    """The history projected once."""
    if binaries() is None:
        raise CommandFailed("no PostgreSQL with PostGIS is installed")
    data = folder / "projection"
    log, seen = McapLog(data / "log"), Projected()
    append_history(log, HISTORY)
    seen.events = log.next_number(MAP_STREAM)
    log.close()
    with running_cluster(durable=True) as cluster:
        database = cluster.created()
        began_s = time.perf_counter()
        with projecting(data, cluster, database, batch_events=BATCH_EVENTS) as served:
            wait_until(
                served.is_ready,
                limit_s=LIMIT_S,
                seen=lambda: seen.resident_mb.append(resident_mb(served.pid)),
            )
            seen.wall_s = time.perf_counter() - began_s
        if taken_in(cluster, database) != seen.events:
            raise CommandFailed(f"{taken_in(cluster, database)} of {seen.events} events are in the database")
    return seen


def of_projection(bench: Workbench, *, value: Callable[[Projected], float]) -> Measurement:
    """A number of the projection."""
    try:
        return Measurement(value=value(projected(bench.folder)), command=COMMAND)
    except (OSError, TimeoutError) as error:
        raise CommandFailed(f"{COMMAND}: {error}") from error


def _figure(name: str, unit: str, target: Bounds | None, value: Callable[[Projected], float]) -> Figure:
    return Figure(name=name, unit=unit, target=target, measure=partial(of_projection, value=value))


FIGURES = (
    _figure("events projected into PostGIS", "1/s", at_least(30_000.0), lambda seen: seen.events / seen.wall_s),
    _figure("memory while projecting, last quarter over second", "1", at_most(1.2), lambda seen: seen.memory_growth),
    _figure("memory while projecting, most", "MB", None, lambda seen: max(seen.resident_mb)),
)

"""How far live perception has come, kept in a file."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from trigpoint.logs.checkpoints import read_checkpoint
from trigpoint.logs.ports import EventLog
from trigpoint_perception.core.fleet_following import FleetFollower
from trigpoint_perception.settings import PerceptionSettings

FORM = 1  # of what is kept; another one is not read


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """The drives as they are followed, by stream the number of the next event they are to be given, the number of the
    next one perception appends, and how many it has appended of each of its boots."""

    settings: PerceptionSettings
    taken: Mapping[str, int]
    appended: int
    said: Mapping[str, int]
    fleet: FleetFollower
    form: int = FORM


def read_progress(path: Path, log: EventLog, *, stream: str, settings: PerceptionSettings) -> Progress | None:
    """What the file keeps; None where there is none, it is damaged, of another form or other settings, or of a log
    that was longer than this one. `stream` is perception's own."""
    kept = read_checkpoint(path)
    if not isinstance(kept, Progress) or (kept.form, kept.settings) != (FORM, settings):
        return None
    reached = {**kept.taken, stream: kept.appended}
    return kept if all(number <= log.next_number(name) for name, number in reached.items()) else None

"""How far live filtering has come, kept in a file: what is lost with it is only the time to read the log again."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from trigpoint.geodesy.projection import MapFrame
from trigpoint.logs.checkpoints import read_checkpoint
from trigpoint_filtering.core.fleet_following import FleetFollower
from trigpoint_filtering.settings import FilterSettings

FORM = 1  # of what is kept; another one is not read


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """The drives as they are followed, and by stream the number of the next event they are to be given."""

    frame: MapFrame
    settings: FilterSettings
    taken: Mapping[str, int]
    fleet: FleetFollower
    form: int = FORM


def read_progress(path: Path, *, frame: MapFrame, settings: FilterSettings) -> Progress | None:
    """What the file keeps; None where there is none, it is damaged, or it is of another frame, form or settings."""
    kept = read_checkpoint(path)
    if not isinstance(kept, Progress):
        return None
    return kept if (kept.form, kept.frame, kept.settings) == (FORM, frame, settings) else None

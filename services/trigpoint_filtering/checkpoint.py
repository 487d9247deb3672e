"""How far live filtering has come, kept in a file: what is lost with it is only the time to read the log again."""

import hashlib
import logging
import os
import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from trigpoint.geodesy.projection import MapFrame
from trigpoint_filtering.core.fleet_following import FleetFollower
from trigpoint_filtering.settings import FilterSettings

FORM = 1  # of what is kept; another one is not read
DIGEST_BYTES = 32

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """The drives as they are followed, and by stream the number of the next event they are to be given."""

    frame: MapFrame
    settings: FilterSettings
    taken: Mapping[str, int]
    fleet: FleetFollower
    form: int = FORM


def write_progress(path: Path, progress: Progress) -> None:
    """The file replaced as a whole; a crash leaves the one before. Raises OSError."""
    body = pickle.dumps(progress)
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_suffix(".new")
    with fresh.open("wb") as file:
        file.write(hashlib.sha256(body).digest() + body)
        file.flush()
        os.fsync(file.fileno())
    fresh.replace(path)


def read_progress(path: Path, *, frame: MapFrame, settings: FilterSettings) -> Progress | None:
    """What the file keeps; None where there is none, it is damaged, or it is of another frame, form or settings."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    digest, body = content[:DIGEST_BYTES], content[DIGEST_BYTES:]
    if hashlib.sha256(body).digest() != digest:
        logger.warning("%s: %d bytes whose digest is another; the log is read again", path, len(content))
        return None
    try:
        kept = pickle.loads(body)  # written by this service into its own data directory, and whole
    except (pickle.UnpicklingError, AttributeError, ImportError, TypeError, ValueError) as error:
        logger.warning("%s: cannot be read, the log is: %s", path, error)
        return None
    known = isinstance(kept, Progress) and (kept.form, kept.frame, kept.settings) == (FORM, frame, settings)
    return kept if known else None

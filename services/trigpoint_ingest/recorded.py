"""Vehicles' logs, whole MCAP files, taken into the log message by message; damage costs only what it hit."""

from collections.abc import Callable, Sequence
from pathlib import Path

from trigpoint.bus.ports import Bus
from trigpoint.errors import EventRejected, InputError, LogDamaged
from trigpoint.logs.mcap_scan import Damage
from trigpoint.logs.ports import RecallingLog
from trigpoint.logs.vehicle_log import read_whole_messages
from trigpoint_ingest.core.ordering import described_first
from trigpoint_ingest.core.tally import DamagedFile, IngestReport
from trigpoint_ingest.core.validation import UNKNOWN_VEHICLE
from trigpoint_ingest.journal import Journal
from trigpoint_ingest.settings import IngestSettings

PROGRESS_COUNT = 1000  # messages between two calls

Progress = Callable[[int], None]


def ingest_logs(
    paths: Sequence[Path],
    log: RecallingLog,
    *,
    bus: Bus | None = None,
    settings: IngestSettings | None = None,
    progress: Progress | None = None,
) -> IngestReport:
    """What came of the vehicles' logs; everything accepted is durable. `progress` hears how many messages more
    were read.

    Raises InputError if a path is no file (before anything is taken), AppendFailed if the log cannot be written:
    what was appended before stays.
    """
    for path in paths:
        if not path.is_file():
            raise InputError(f"{path} is not a file: an MCAP log of a vehicle is needed")
    chosen = settings if settings is not None else IngestSettings()
    journal = Journal(log, bus, chosen)
    for path in paths:
        _ingest_file(path, journal, chosen, progress=progress or _nobody)
    return journal.tally.report()


def _nobody(count: int) -> None:
    """Hears of progress, and does nothing."""


def _ingest_file(path: Path, journal: Journal, settings: IngestSettings, *, progress: Progress) -> None:
    damages: list[Damage] = []
    count = 0
    try:
        for message, described in described_first(read_whole_messages(path, damages)):
            if described:
                journal.take(message)
            else:
                detail = f"{message.identity.source!r} does not describe itself in {path.name}"
                journal.refuse(message, EventRejected(UNKNOWN_VEHICLE, detail))
            if journal.pending_count >= settings.batch_count or journal.pending_bytes >= settings.pending_bytes:
                journal.flush()
            count += 1
            if count % PROGRESS_COUNT == 0:
                progress(PROGRESS_COUNT)
    except LogDamaged as error:
        journal.tally.damaged.append(DamagedFile(str(path), str(error)))
    journal.tally.damaged.extend(DamagedFile(str(path), str(damage)) for damage in damages)
    journal.flush()
    progress(count % PROGRESS_COUNT)

"""What ingest has to know of the log when it starts: identities as ranges, times, and what was refused."""

from typing import cast

from trigpoint.events.envelope import Envelope
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.observed import EventRefused, VehicleDescribed
from trigpoint.logs.ports import RecallingLog
from trigpoint.logs.readings import vehicle_streams
from trigpoint_ingest.core.admission import Admission
from trigpoint_ingest.core.refusal import refused_identity
from trigpoint_ingest.settings import IngestSettings

REFUSED_STREAM = STREAM_PATTERNS[EventRefused]


def admission_from(log: RecallingLog, settings: IngestSettings) -> Admission:
    """The memory of what the log holds: identities, descriptions and times of its vehicles, and refusals.

    No event of a vehicle is decoded, and no more of them than a chunk holds are in memory.
    """
    admission = Admission(fleet=settings.fleet, limits=settings.stamps, drive_limit=settings.drive_limit)
    own = {STREAM_PATTERNS[VehicleDescribed].format(vehicle=vehicle) for vehicle in settings.vehicles}
    for stream in vehicle_streams(log):
        if not own or stream in own:
            for boot in (boot for absence in log.absences(stream) for boot in absence.boots):
                admission.recall_retained(boot.source, boot.boot_id, boot.ranges)
            for run in log.read_headers(stream):
                admission.recall_run(run)
    for row in log.read(REFUSED_STREAM, kinds=(EventRefused,)):
        admission.refuse(refused_identity(cast(Envelope[EventRefused], row.envelope)))
    return admission

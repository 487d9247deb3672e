"""`trigpoint ingest`: vehicles' logs into a data directory."""

from pathlib import Path

import click

from trigpoint.errors import InputError
from trigpoint_cli.data_dir import DataDirectory, data_option
from trigpoint_cli.output import Answer, JsonObject, Screen, answering
from trigpoint_ingest.core.tally import IngestReport
from trigpoint_ingest.recorded import ingest_logs


def ingest_values(report: IngestReport) -> JsonObject:
    """The report as a JSON object."""
    return {
        "accepted": report.accepted,
        "duplicates": report.duplicates,
        "refused": dict(report.refused),
        "vehicles": {
            one.vehicle: {"accepted": one.accepted, "duplicates": one.duplicates, "refused": dict(one.refused)}
            for one in report.vehicles
        },
        "damaged": [{"path": one.path, "detail": one.detail} for one in report.damaged],
    }


@click.command("ingest")
@click.argument("logs", nargs=-1, required=True, metavar="LOG...", type=click.Path(path_type=Path))
@data_option
@answering
def command(logs: tuple[Path, ...], data: DataDirectory, *, screen: Screen) -> Answer:
    """Take vehicles' logs (MCAP) into a data directory, each message once.

    What is refused or damaged is said, kept aside where it can be, and ends the command with status 2 after
    everything else was taken in.
    """
    missing = [str(path) for path in logs if not path.is_file()]
    if missing:
        raise InputError(f"{', '.join(missing)}: no such file; an MCAP log of a vehicle is needed")
    with data.new_log() as log, screen.counting("ingesting", unit="messages") as progress:
        report = ingest_logs(logs, log, progress=progress)
    lines = [f"{one.vehicle}: {one.accepted} events taken in, {one.duplicates} known" for one in report.vehicles]
    return Answer(ingest_values(report), tuple(lines), report.complaints())

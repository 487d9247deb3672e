"""`trigpoint log`: what log files hold, whether they are whole, and how they stay so."""

from pathlib import Path

import click

from trigpoint.logs.findings import FileSummary, Finding
from trigpoint.logs.verification import Verification, verify
from trigpoint_cli.data_dir import LOG_NAME
from trigpoint_cli.log_keeping import recover_command, retain_command, seal_command
from trigpoint_cli.output import Answer, JsonObject, Screen, answering, utc


@click.group("log", help="What log files hold, whether they are whole, and how they stay so.")
def command() -> None:
    """Group of what can be asked of log files."""


for keeping in (seal_command, retain_command, recover_command):
    command.add_command(keeping)


def _verified(path: Path) -> Verification:
    inside = path / LOG_NAME
    return verify(inside if inside.is_dir() else path)


def _file_values(file: FileSummary) -> JsonObject:
    return {
        "path": str(file.path),
        "stream": file.stream,
        "size_bytes": file.size_bytes,
        "count": file.count,
        "start_ns": file.start_ns,
        "end_ns": file.end_ns,
        "vehicles": list(file.vehicles),
        "topics": [{"topic": topic.topic, "schema": topic.schema_name, "count": topic.count} for topic in file.topics],
        "metadata": {name: dict(record) for name, record in file.metadata.items()},
    }


def _finding_values(finding: Finding) -> JsonObject:
    return {
        "path": str(finding.path),
        "offset": finding.offset,
        "kind": finding.kind,
        "detail": finding.detail,
        "lost_messages": finding.lost_messages,
    }


def _line(finding: Finding) -> str:
    return f"{finding.path}, byte {finding.offset}: {finding.kind}: {finding.detail}"


@command.command("info")
@click.argument("path", metavar="DIR", type=click.Path(path_type=Path))
@answering
def info(path: Path, *, screen: Screen) -> Answer:
    """What the log files in DIR (a data directory, a log, a folder or one file) hold."""
    found = _verified(path)
    count = sum(file.count for file in found.files)
    lines = [
        f"{file.stream}: {file.count} events, {file.size_bytes / 1e6:.1f} MB, {utc(file.start_ns)} to "
        f"{utc(file.end_ns)}, {', '.join(sorted({topic.schema_name for topic in file.topics}))}"
        for file in found.files
    ]
    values = {
        "count": count,
        "files": [_file_values(file) for file in found.files],
        "boots": [
            {"source": boot.source, "boot_id": boot.boot_id, "count": boot.count, "missing": boot.missing}
            for boot in found.boots
        ],
        "findings": [_finding_values(finding) for finding in found.findings],
    }
    return Answer(values, (*lines, f"{count} events in {len(found.files)} files", *map(_line, found.findings)))


@command.command("verify")
@click.argument("path", metavar="DIR", type=click.Path(path_type=Path))
@answering
def verify_command(path: Path, *, screen: Screen) -> Answer:
    """Check every checksum, chunk, number and identity of the log files in DIR; status 2 if anything is wrong."""
    found = _verified(path)
    count = sum(file.count for file in found.files)
    values = {
        "whole": not found.findings,
        "count": count,
        "files": len(found.files),
        "findings": [_finding_values(finding) for finding in found.findings],
        "absences": [
            {
                "stream": stream,
                "numbers": [absence.first_number, absence.stop_number],
                "reason": absence.reason.value,
            }
            for stream, absence in found.absences
        ],
        "written_streams": list(found.written_streams),
    }
    lines = (
        f"{count} events in {len(found.files)} files, {len(found.findings)} findings",
        *(f"{stream}: being written, its last file has no end yet" for stream in found.written_streams),
        *(
            f"{stream}: numbers {absence.first_number} to {absence.stop_number - 1}: {absence.reason.value}"
            for stream, absence in found.absences
        ),
    )
    return Answer(values, lines, tuple(map(_line, found.findings)))

"""`trigpoint log seal|retain|recover`: a log kept whole, small enough, and rescued."""

import json
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import click

from trigpoint.configuration.sections import LogSettings
from trigpoint.errors import InputError
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.recovery import StreamRecovery, recover
from trigpoint.logs.retention import (
    Checkpoints,
    Keeping,
    LogFile,
    log_files,
    obstacles,
    planned_retention,
    remove_files,
)
from trigpoint.logs.seals import seal_finished
from trigpoint_cli.data_dir import LOG_NAME, DataDirectory
from trigpoint_cli.output import Answer, JsonObject, Screen, answering
from trigpoint_cli.settings import configuration_options, log_settings

NS_PER_DAY = 86_400_000_000_000
CHECKPOINT_LIMIT_BYTES = 16 * 1024 * 1024

directory_argument = click.argument("path", metavar="DIR", type=click.Path(path_type=Path))


def log_directory(path: Path) -> Path:
    """The log of a data directory, or the directory itself. Raises InputError where there is none."""
    inside = path / LOG_NAME
    found = inside if inside.is_dir() else path
    if not found.is_dir():
        raise InputError(f"{path}: no such directory")
    return found


@click.command("seal")
@directory_argument
@answering
def seal_command(path: Path, *, screen: Screen) -> Answer:
    """End and seal every file of the log in DIR that nobody writes: a SHA-256 beside each, which `verify` holds it to.

    Streams with a running writer keep their last file; status 2 if a finished file is damaged, which is not sealed.
    """
    directory = log_directory(path)
    with closing(McapLog(directory)) as log:
        written = log.end_abandoned()
        sealings = [seal_finished(directory / stream) for stream in log.streams()]
    sealed = [str(one) for sealing in sealings for one in sealing.sealed]
    faults = tuple(fault for sealing in sealings for fault in sealing.faults)
    values = {"sealed": sealed, "written_streams": list(written), "faults": list(faults)}
    lines = (
        f"{len(sealed)} files sealed",
        *(f"{stream}: being written, its last file stays open" for stream in written),
    )
    return Answer(values, lines, faults)


@click.command("retain")
@directory_argument
@click.option("--keep-days", type=click.FloatRange(min=0.0), help="Keep what was measured in so many last days.")
@click.option("--keep-bytes", type=click.IntRange(min=0), help="Keep the newest files of so many bytes together.")
@configuration_options
@click.option(
    "--checkpoints",
    "checkpoint_files",
    metavar="FILE",
    multiple=True,
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help='JSON: {"reader": {"stream": next number}} of everything that reads the log.',
)
@click.option("--passed", metavar="READER:STREAM=NUMBER", multiple=True, help="The same, one at a time.")
@click.option("--also-inputs", is_flag=True, help="Let go of what the newest map version was solved from, too.")
@click.option("--dry-run", is_flag=True, help="Only say what would go.")
@answering
def retain_command(path: Path, *, screen: Screen, **options: Any) -> Answer:
    """Take the oldest sealed files out of the log in DIR, where every reader has passed them, and record that.

    Without --keep-days and --keep-bytes, [log] keep_days or keep_bytes of the configuration says how much stays. The
    landmark database beside the log is a reader of itself. The newest map version, the map's frame and corrections
    always stay.
    """
    keeping = _keeping(options["keep_days"], options["keep_bytes"], log_settings(options["config"], options["flags"]))
    directory = log_directory(path)
    passed = _checkpoints(options["checkpoint_files"], options["passed"]) | _database_checkpoint(path)
    with closing(McapLog(directory)) as log:
        held = obstacles(log, passed, also_inputs=options["also_inputs"])
        plan = planned_retention(log_files(log), held, keeping)
        if not options["dry_run"]:
            remove_files(directory, plan.removed)
    values = {
        "removed": [_file_values(file) for file in plan.removed],
        "removed_bytes": plan.freed_bytes,
        "left_bytes": plan.total_bytes - plan.freed_bytes,
        "kept_because": dict(plan.kept_because),
        "dry_run": options["dry_run"],
    }
    would = "would be " if options["dry_run"] else ""
    lines = [f"{file.stream}: numbers {file.first_number} to {file.stop_number - 1}" for file in plan.removed]
    kept = [f"{stream} stays from there on: {reason}" for stream, reason in plan.kept_because]
    return Answer(values, (f"{len(plan.removed)} files {would}taken away", *lines, *kept))


def _keeping(keep_days: float | None, keep_bytes: int | None, configured: LogSettings) -> Keeping:
    """What was asked for, or else is configured. Raises click.UsageError where that is neither, or both."""
    if keep_days is None and keep_bytes is None:
        keep_days, keep_bytes = configured.keep_days, configured.keep_bytes
    if (keep_days is None) == (keep_bytes is None):
        raise click.UsageError("say either --keep-days or --keep-bytes, or configure one of them under [log]")
    if keep_days is None:
        return Keeping(total_bytes=keep_bytes)
    return Keeping(newer_than_ns=time.time_ns() - round(keep_days * NS_PER_DAY))


def _file_values(file: LogFile) -> JsonObject:
    return {
        "stream": file.stream,
        "first_number": file.first_number,
        "stop_number": file.stop_number,
        "size_bytes": file.size_bytes,
        "start_ns": file.start_ns,
        "end_ns": file.end_ns,
    }


def _checkpoints(files: tuple[Path, ...], passed: tuple[str, ...]) -> dict[str, dict[str, int]]:
    """What the readers say. Raises InputError for what is no checkpoint."""
    found: dict[str, dict[str, int]] = {}
    for file in files:
        for reader, numbers in _read(file).items():
            found.setdefault(reader, {}).update(numbers)
    for one in passed:
        reader, colon, rest = one.partition(":")
        stream, equals, number = rest.rpartition("=")
        if not (colon and equals and reader and stream and number.isdecimal()):
            raise InputError(f"--passed {one!r}: expected READER:STREAM=NUMBER")
        found.setdefault(reader, {})[stream] = int(number)
    return found


def _read(file: Path) -> Checkpoints:
    size_bytes = file.stat().st_size
    if size_bytes > CHECKPOINT_LIMIT_BYTES:
        raise InputError(f"{file}: {size_bytes} bytes, at most {CHECKPOINT_LIMIT_BYTES} are read")
    try:
        said = json.loads(file.read_bytes())
        found = {str(reader): dict(numbers) for reader, numbers in said.items()}
    except (ValueError, AttributeError, TypeError, RecursionError) as error:
        raise InputError(f'{file}: no checkpoints, {{"reader": {{"stream": number}}}}: {error}') from error
    for reader, numbers in found.items():
        for stream, number in numbers.items():
            if type(number) is not int or number < 0:
                raise InputError(f"{file}: {reader}, {stream}: {number!r} is not a number from 0 on")
    return found


def _database_checkpoint(path: Path) -> dict[str, dict[str, int]]:
    """How far the landmark database of a data directory has read, if there is one."""
    data = DataDirectory(path)
    if not data.database.is_file():
        return {}
    with closing(GeoPackageStore(data.database, read_only=True)) as store:
        return {data.database.name: dict(store.checkpoint().next_numbers)}


@click.command("recover")
@click.argument("source", metavar="SRC", type=click.Path(path_type=Path))
@click.argument("out", metavar="OUT", type=click.Path(path_type=Path))
@answering
def recover_command(source: Path, out: Path, *, screen: Screen) -> Answer:
    """Write everything whole of the log in SRC into a new log OUT, open and verify that, and say what is lost.

    Events keep their numbers. SRC is only read. Status 1 if OUT does not verify.
    """
    with screen.counting("recovering", unit="files") as count:
        recovered = recover(log_directory(source), out, told=lambda path: count(1))
    count_all, lost = sum(one.count for one in recovered), sum(one.lost_count for one in recovered)
    values = {
        "verified": True,
        "count": count_all,
        "lost": lost,
        "streams": [_stream_values(one) for one in recovered],
    }
    lines = [f"{count_all} events in {len(recovered)} streams, reopened and verified; {lost} lost"]
    return Answer(values, (*lines, *(line for one in recovered for line in _loss_lines(one))))


def _stream_values(recovered: StreamRecovery) -> JsonObject:
    return {
        "stream": recovered.stream,
        "count": recovered.count,
        "lost": recovered.lost_count,
        "lost_numbers": [[first, stop] for first, stop in recovered.lost_ranges],
        "missing": [
            {"source": one.source, "boot_id": one.boot_id, "sequences": [one.start, one.stop]}
            for one in recovered.missing
        ],
        "damages": list(recovered.damages),
        "uncertain_files": [str(path) for path in recovered.uncertain_files],
        "end_unknown": recovered.end_unknown,
    }


def _loss_lines(recovered: StreamRecovery) -> list[str]:
    stream = recovered.stream
    lines = [f"{stream}: numbers {first} to {stop - 1} are lost" for first, stop in recovered.lost_ranges]
    lines += [
        f"{stream}: {one.source}, boot {one.boot_id}: sequences {one.start} to {one.stop - 1} are not there"
        for one in recovered.missing
    ]
    lines += [f"{path}: numbers after a damage are the lowest possible" for path in recovered.uncertain_files]
    if recovered.end_unknown:
        lines.append(f"{stream}: its end is damaged; whether more events stood there is not known")
    return lines

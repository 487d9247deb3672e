"""`trigpoint replay`: every projection made again from the log and held against the one that is there."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path

import click

from trigpoint.errors import InputError, ServiceError
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import Progress, in_silence
from trigpoint.workers import workers
from trigpoint_cli.data_dir import DataDirectory, cluster_option, several_data_option
from trigpoint_cli.database import database_options
from trigpoint_cli.output import Answer, JsonObject, Screen, answering, counted
from trigpoint_landmarks.app import project, replay_difference

LISTED = 20  # differences said in full

ProgressOf = Callable[[str], Progress]  # the progress of what is being done


@click.command("replay")
@several_data_option
@database_options
@cluster_option
@click.option("--restore", is_flag=True, help="First take into the database what it lacks, from nothing if it is gone.")
@answering
def command(data: tuple[DataDirectory, ...], *, restore: bool, cluster: str, screen: Screen) -> Answer:
    """Rebuild every projection from the log and say whether anything differs (then status 2).

    Several data directories are replayed side by side, by threads or a cluster's workers; one that cannot be read
    costs no other.
    """
    if len(data) > 1:
        return _several(data, _side_by_side(data, restore=restore, cluster=cluster, screen=screen))
    if cluster:
        (values,) = _side_by_side(data, restore=restore, cluster=cluster, screen=screen).values()
    else:
        with ExitStack() as bars:
            part_of = partial(_shown, bars, screen)
            values = _replayed(data[0], restore=restore, progress_of=part_of)
    if "error" in values:
        raise InputError(values["error"])
    late = (f"{stream}: the log begins at number {number}, not at 0" for stream, number in values["begins_at"].items())
    restored = values["restored_versions"]
    lines = (*late, *((f"{len(restored)} map versions restored",) if restored else ()))
    return Answer(values, lines if values["differences"] else (*lines, "no difference"), _complaints(values))


def _shown(bars: ExitStack, screen: Screen, what: str) -> Progress:
    return bars.enter_context(screen.part_of(what))


def _several(data: Sequence[DataDirectory], answers: Mapping[str, JsonObject]) -> Answer:
    """Each data directory's own answer, in the order they were named in."""
    each = [{"data": path, **answers[path]} for path in (str(one.path.absolute()) for one in data)]
    differences = sum(one.get("differences", 0) for one in each)
    lines = tuple(f"{one['data']}: {counted(one['differences'], 'difference')}" for one in each if "differences" in one)
    complaints = tuple(f"{one['data']}: {complaint}" for one in each for complaint in _complaints(one))
    return Answer({"data": each, "differences": differences}, lines, complaints)


def _side_by_side(
    data: Sequence[DataDirectory], *, restore: bool, cluster: str, screen: Screen
) -> Mapping[str, JsonObject]:
    """What was found in each data directory, or the "error" that it could not be read with, by its path.

    Raises ServiceError, once all are done, for those the environment failed.
    """
    due = {str(one.path.absolute()): one for one in data}
    if len(due) < len(data):
        raise InputError(f"--data: {len(data)} given, {len(due)} of them different; each is replayed once")
    if len(data) > 1 and data[0].asked.url is not None:
        raise InputError(f"--database names one landmark database, --data {len(data)} directories: each has its own")
    answers: dict[str, JsonObject] = {}
    failures: list[str] = []
    with workers(cluster) as some, screen.part_of("replaying") as progress:
        for done in some.each(partial(_replayed_at, restore=restore), due.items()):
            path = done.item[0]
            if done.result is not None:
                answers[path] = done.result
            elif isinstance(done.error, InputError):
                answers[path] = {"error": str(done.error)}
            else:
                failures.append(f"{path}: {done.error}")
            progress(len(answers) + len(failures), len(due))
    if failures:
        raise ServiceError(f"{len(failures)} of {len(due)} logs not replayed: {'; '.join(failures)}")
    return answers


def _replayed_at(at: tuple[str, DataDirectory], *, restore: bool) -> JsonObject:
    path, data = at
    return _replayed(replace(data, path=Path(path)), restore=restore, progress_of=lambda what: in_silence)


def _replayed(data: DataDirectory, *, restore: bool, progress_of: ProgressOf) -> JsonObject:
    """Where the database differs from what its log says, and what was restored before."""
    with data.opened_log() as log:
        begins = {stream: log.begins_at(stream) for stream in log.streams() if log.begins_at(stream) > 0}
        restored = _restored(data, log, progress_of("restoring")) if restore else ()
        with data.opened_database(read_only=True) as held:
            found = replay_difference(log, held, progress=progress_of("replaying"))
    listed = [{"table": one.table, "key": one.key, "detail": one.detail} for one in found[:LISTED]]
    return {"restored_versions": list(restored), "differences": len(found), "listed": listed, "begins_at": begins}


def _restored(data: DataDirectory, log: EventLog, progress: Progress) -> tuple[int, ...]:
    """The map versions the database lacked and now has."""
    with data.opened_database(read_only=False) as store:
        return project(log, store, progress=progress).applied


def _complaints(values: JsonObject) -> tuple[str, ...]:
    """What is wrong with one data directory."""
    if "error" in values:
        return (values["error"],)
    return tuple(f"{one['table']} {one['key']}: {one['detail']}" for one in values["listed"])

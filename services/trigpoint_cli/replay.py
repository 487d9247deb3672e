"""`trigpoint replay`: every projection made again from the log and held against the one that is there."""

import click

from trigpoint.logs.ports import EventLog
from trigpoint_cli.data_dir import DataDirectory, data_option
from trigpoint_cli.database import database_options
from trigpoint_cli.output import Answer, Screen, answering
from trigpoint_landmarks.app import project, replay_difference

LISTED = 20  # differences said in full


@click.command("replay")
@data_option
@database_options
@click.option("--restore", is_flag=True, help="First take into the database what it lacks, from nothing if it is gone.")
@answering
def command(data: DataDirectory, restore: bool, *, screen: Screen) -> Answer:
    """Rebuild every projection from the log and say whether anything differs (then status 2)."""
    with data.opened_log() as log:
        begins = {stream: log.begins_at(stream) for stream in log.streams() if log.begins_at(stream) > 0}
        restored = _restored(data, log, screen) if restore else ()
        with data.opened_database(read_only=True) as held, screen.part_of("replaying") as progress:
            found = replay_difference(log, held, progress=progress)
    said = [{"table": one.table, "key": one.key, "detail": one.detail} for one in found[:LISTED]]
    complaints = tuple(f"{one['table']} {one['key']}: {one['detail']}" for one in said)
    values = {"restored_versions": list(restored), "differences": len(found), "listed": said, "begins_at": begins}
    late = (f"{stream}: the log begins at number {number}, not at 0" for stream, number in begins.items())
    lines = (*late, *((f"{len(restored)} map versions restored",) if restored else ()))
    return Answer(values, lines if found else (*lines, "no difference"), complaints)


def _restored(data: DataDirectory, log: EventLog, screen: Screen) -> tuple[int, ...]:
    """The map versions the database lacked and now has."""
    with data.opened_database(read_only=False) as store, screen.part_of("restoring") as progress:
        return project(log, store, progress=progress).applied

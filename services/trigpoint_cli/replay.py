"""`trigpoint replay`: every projection made again from the log and held against the one that is there."""

import click

from trigpoint_cli.data_dir import DataDirectory, data_option
from trigpoint_cli.database import database_options
from trigpoint_cli.output import Answer, Screen, answering
from trigpoint_landmarks.app import replay_difference

LISTED = 20  # differences said in full


@click.command("replay")
@data_option
@database_options
@answering
def command(data: DataDirectory, *, screen: Screen) -> Answer:
    """Rebuild every projection from the log and say whether anything differs (then status 2)."""
    with (
        data.opened_log() as log,
        data.opened_database(read_only=True) as held,
        screen.part_of("replaying") as progress,
    ):
        found = replay_difference(log, held, progress=progress)
    said = [{"table": one.table, "key": one.key, "detail": one.detail} for one in found[:LISTED]]
    complaints = tuple(f"{one['table']} {one['key']}: {one['detail']}" for one in said)
    return Answer({"differences": len(found), "listed": said}, ("no difference",) if not found else (), complaints)

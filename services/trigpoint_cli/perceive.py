"""`trigpoint perceive`: the landmarks and motions that lidar sweeps show."""

from functools import partial

import click

from trigpoint.errors import InputError
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.ports import EventLog
from trigpoint.workers import Workers, workers
from trigpoint_cli.data_dir import DataDirectory, cluster_option, data_option
from trigpoint_cli.output import Answer, JsonObject, Screen, answering, counted
from trigpoint_perception.app import DriveReport, perceive_log
from trigpoint_perception.closing import LoopReport, close_loops


@click.command("perceive")
@data_option
@cluster_option
@answering
def command(data: DataDirectory, *, cluster: str, screen: Screen) -> Answer:
    """Search the sweeps of every drive that is not excluded for poles and building corners, match them for odometry,
    and close its loops: places it comes back to, or that another drive was at. What was said already is not said again.

    Sweeps that cannot be used are counted by reason, kept with it in the log, and end the command with status 2 after
    everything else was done.
    """
    with data.opened_log() as log, workers(cluster) as some:
        reports, loops = perceived(log, data, some, screen)
    if not reports:
        raise InputError(f"{data.log}: no drive has lidar sweeps, or all that have are excluded")
    complaints = tuple(
        f"{one.vehicle} {one.boot_id}: {counted(count, 'sweep')} refused: {reason}"
        for one in reports
        for reason, count in one.refused
    )
    values = {
        "drives": [_item(one) for one in reports],
        "loops": [_loop_item(one) for one in loops],
        "appended": sum(one.appended for one in reports) + sum(one.appended for one in loops),
    }
    return Answer(values, (*map(_line, reports), *map(_loop_line, loops)), complaints)


def perceived(
    log: EventLog, data: DataDirectory, some: Workers, screen: Screen
) -> tuple[tuple[DriveReport, ...], tuple[LoopReport, ...]]:
    """What every drive's sweeps show, and the loops they close, appended to the log."""
    open_log = partial(McapLog, data.log.absolute())
    with screen.part_of("perceiving") as progress:
        reports = perceive_log(log, open_log, some=some, progress=progress)
    with screen.part_of("closing loops") as progress:
        return reports, close_loops(log, open_log, some=some, progress=progress)


def _item(one: DriveReport) -> JsonObject:
    return {
        "vehicle": one.vehicle,
        "boot_id": one.boot_id,
        "sweeps": one.sweeps,
        "refused": dict(one.refused),
        "matched": one.matched,
        "sights": one.sights,
        "poles": one.poles,
        "corners": one.corners,
        "appended": one.appended,
    }


def _line(one: DriveReport) -> str:
    return (
        f"{one.vehicle}: {counted(one.sweeps, 'sweep')}, {one.matched} matched; {counted(one.poles, 'pole')} and "
        f"{counted(one.corners, 'corner')} seen {one.sights} times; {one.appended} events appended"
    )


def _loop_item(one: LoopReport) -> JsonObject:
    return {
        "vehicle": one.vehicle,
        "boot_id": one.boot_id,
        "proposed": one.proposed,
        "verified": one.verified,
        "refused": dict(one.refused),
        "drives_apart": one.drives_apart,
        "appended": one.appended,
    }


def _loop_line(one: LoopReport) -> str:
    reasons = "".join(f"; {count} refused: {reason}" for reason, count in one.refused)
    apart = f"; {counted(one.drives_apart, 'drive')} elsewhere not searched" if one.drives_apart else ""
    return f"{one.vehicle}: {counted(one.proposed, 'loop')} proposed, {one.verified} closed{reasons}{apart}"

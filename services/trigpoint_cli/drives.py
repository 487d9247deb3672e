"""`trigpoint drives`: what was driven, and which drives the map is solved without."""

import click

from trigpoint_cli.corrections import attributed, attribution_options, correction_answer
from trigpoint_cli.data_dir import DataDirectory, data_option
from trigpoint_cli.output import Answer, JsonObject, Screen, answering, counted, utc
from trigpoint_ingest.core.standing import DriveStanding
from trigpoint_ingest.corrections import exclude_drives, include_drives, logged_drive_standings

boot_option = click.option("--boot", "boot_id", metavar="ID", help="Only the drive of this boot.")


@click.group("drives", help="What was driven, and which drives the map is solved without.")
def command() -> None:
    """Group of what can be done with drives."""


@command.command("list")
@data_option
@answering
def list_drives(data: DataDirectory, *, screen: Screen) -> Answer:
    """Every drive in the log; its times are those of the chunks it is in."""
    with data.opened_log() as log:
        standings = logged_drive_standings(log)
    excluded = sum(one.excluded for one in standings)
    values = {"drives": {"count": len(standings), "excluded": excluded, "items": list(map(_item, standings))}}
    return Answer(values, (*map(_line, standings), f"{counted(len(standings), 'drive')}, {excluded} of them excluded"))


@command.command("exclude")
@click.argument("vehicle")
@data_option
@boot_option
@attribution_options
@answering
def exclude(
    vehicle: str, data: DataDirectory, boot_id: str | None, reason: str, author: str | None, *, screen: Screen
) -> Answer:
    """Leave VEHICLE's drives out: the next map version is as if they had never been."""
    with data.opened_log() as log:
        report = exclude_drives(log, vehicle, boot_id=boot_id, by=attributed(author, reason))
    return correction_answer(report, "drive", past="excluded")


@command.command("include")
@click.argument("vehicle")
@data_option
@boot_option
@attribution_options
@answering
def include(
    vehicle: str, data: DataDirectory, boot_id: str | None, reason: str, author: str | None, *, screen: Screen
) -> Answer:
    """Let VEHICLE's excluded drives take part again."""
    with data.opened_log() as log:
        report = include_drives(log, vehicle, boot_id=boot_id, by=attributed(author, reason))
    return correction_answer(report, "drive", past="included")


def _item(one: DriveStanding) -> JsonObject:
    said = one.corrected
    return {
        "vehicle": one.vehicle,
        "boot_id": one.boot_id,
        "start_ns": one.start_ns,
        "end_ns": one.end_ns,
        "excluded": one.excluded,
        "author": None if said is None else said.author,
        "reason": None if said is None else said.reason,
    }


def _line(one: DriveStanding) -> str:
    line = f"{one.vehicle}  {one.boot_id}  {utc(one.start_ns)} to {utc(one.end_ns)}"
    if one.corrected is None:
        return line
    said = "excluded" if one.excluded else "included again"
    return f"{line}  {said} by {one.corrected.author}: {one.corrected.reason or 'no reason given'}"

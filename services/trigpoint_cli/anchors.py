"""`trigpoint anchors`: positions people labelled in aerial images."""

from pathlib import Path

import click

from trigpoint_cli.corrections import attributed, attribution_options, correction_answer
from trigpoint_cli.data_dir import DataDirectory, data_option
from trigpoint_cli.output import Answer, JsonObject, Screen, answering, counted
from trigpoint_ingest.anchor_files import read_anchor_file
from trigpoint_ingest.anchors import AnchorImportReport, import_anchors
from trigpoint_ingest.core.standing import AnchorStanding
from trigpoint_ingest.corrections import logged_anchor_standings, retract_anchor


@click.group("anchors", help="Anchors labelled in aerial images or surveyed.")
def command() -> None:
    """Group of what can be done with anchors."""


def anchor_values(report: AnchorImportReport) -> JsonObject:
    """The report as a JSON object."""
    return {
        "anchors": {
            "added": report.added,
            "known": report.known,
            "relabelled": report.relabelled,
            "refused": len(report.refused),
        },
        "complaints": list(report.complaints()),
    }


@command.command("import")
@click.argument("file", type=click.Path(path_type=Path))
@data_option
@click.option("--image", metavar="ID", help="The image they were all labelled in.")
@click.option("--sigma-m", type=float, metavar="S", help="1-sigma of every label per axis, in metres.")
@click.option("--crs", metavar="CRS", help="The positions' CRS, as EPSG:32756, where the file states none.")
@answering
def import_file(
    file: Path, data: DataDirectory, image: str | None, sigma_m: float | None, crs: str | None, *, screen: Screen
) -> Answer:
    """Take the anchors of FILE (GeoJSON, GeoPackage or CSV) into the log."""
    found = read_anchor_file(file, crs=crs, image=image, sigma_m=sigma_m)
    with data.new_log() as log:
        report = import_anchors(found, log)
    line = f"{report.added} anchors added ({report.relabelled} of them labelled anew), {report.known} known"
    return Answer(anchor_values(report), (line,), report.complaints())


@command.command("retract")
@click.argument("anchor", metavar="NAME")
@data_option
@click.option("--image", metavar="ID", help="The image it was labelled in, where that is not the only one.")
@attribution_options
@answering
def retract(
    anchor: str, data: DataDirectory, image: str | None, reason: str, author: str | None, *, screen: Screen
) -> Answer:
    """Take the anchor NAME back: the next map version is as if it had never been labelled.

    Importing it again labels it anew.
    """
    with data.opened_log() as log:
        report = retract_anchor(log, anchor, image=image, by=attributed(author, reason))
    return correction_answer(report, "anchor", past="retracted")


@command.command("list")
@data_option
@answering
def list_anchors(data: DataDirectory, *, screen: Screen) -> Answer:
    """Every anchor ever labelled, and whether it holds."""
    with data.opened_log() as log:
        standings = logged_anchor_standings(log)
    in_force = sum(one.retracted is None for one in standings)
    values = {"anchors": {"count": len(standings), "in_force": in_force, "items": list(map(_item, standings))}}
    return Answer(values, (*map(_line, standings), f"{counted(len(standings), 'anchor')}, {in_force} of them in force"))


def _item(one: AnchorStanding) -> JsonObject:
    label, retracted = one.label, one.retracted
    return {
        "anchor": label.anchor,
        "image": label.image,
        "kind": label.kind,
        "signature": label.signature,
        "lat_deg": label.lat_deg,
        "lon_deg": label.lon_deg,
        "sigma_m": label.sigma_m,
        "image_sigma_m": label.image_sigma_m,
        "in_force": retracted is None,
        "retracted": None if retracted is None else {"author": retracted.author, "reason": retracted.reason},
    }


def _line(one: AnchorStanding) -> str:
    label = one.label
    place = f"{label.anchor}  {label.image or 'survey'}  {label.lat_deg:.8f} {label.lon_deg:.8f}"
    if one.retracted is None:
        return f"{place}  sigma {label.sigma_m:.2f} m"
    return f"{place}  retracted by {one.retracted.author}: {one.retracted.reason or 'no reason given'}"

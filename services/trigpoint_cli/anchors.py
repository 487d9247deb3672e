"""`trigpoint anchors`: positions people labelled in aerial images."""

from pathlib import Path

import click

from trigpoint_cli.data_dir import DataDirectory, data_option
from trigpoint_cli.output import Answer, JsonObject, Screen, answering
from trigpoint_ingest.anchor_files import read_anchor_file
from trigpoint_ingest.anchors import AnchorImportReport, import_anchors


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

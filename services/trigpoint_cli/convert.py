"""`trigpoint convert`: recorded data becomes vehicles' logs, with truth and anchors beside them."""

from pathlib import Path

import click

from trigpoint_cli.output import Answer, Screen, answering
from trigpoint_vehicle import app as vehicle
from trigpoint_vehicle.app import Written
from trigpoint_vehicle.cloud_conversion import WrittenClouds

SOURCE = click.Path(exists=False, path_type=Path)


@click.group("convert", help="Turn recorded data into vehicles' logs.")
def command() -> None:
    """Group of the importers."""


def _answer(written: Written) -> Answer:
    values = {
        "logs": [str(path) for path in written.logs],
        "vehicles": {path.stem: {"log": str(path), "size_bytes": path.stat().st_size} for path in written.logs},
        "truth": None if written.truth is None else str(written.truth),
        "anchors": None if written.anchors is None else str(written.anchors),
    }
    beside = [path for path in (written.truth, written.anchors) if path is not None]
    return Answer(values, tuple(f"wrote {path}" for path in (*written.logs, *beside)))


@command.command("victoria-park")
@click.argument("source", type=SOURCE)
@click.argument("out_dir", type=SOURCE)
@answering
def victoria_park(source: Path, out_dir: Path, *, screen: Screen) -> Answer:
    """The Victoria Park drive (gps.dat, inputs.dat, measurements.dat) in folder SOURCE."""
    return _answer(vehicle.convert_victoria_park(source, out_dir))


@command.command("mrclam")
@click.argument("source", type=SOURCE)
@click.argument("out_dir", type=SOURCE)
@answering
def mrclam(source: Path, out_dir: Path, *, screen: Screen) -> Answer:
    """A UTIAS multi-robot set (RobotN_*.dat, Barcodes.dat) in folder SOURCE."""
    return _answer(vehicle.convert_mrclam(source, out_dir))


def _cloud_answer(written: WrittenClouds) -> Answer:
    aside = written.left_aside
    values = {
        "logs": [str(written.log)],
        "vehicles": {written.log.stem: {"log": str(written.log), "size_bytes": written.log.stat().st_size}},
        "events": written.counts,
        "left_aside": dict(aside.counts),
    }
    counts = ", ".join(f"{count} {name}" for name, count in sorted(written.counts.items()))
    return Answer(values, (f"wrote {written.log}: {counts}",), aside.complaints())


@command.command("kitti")
@click.argument("source", type=SOURCE)
@click.argument("out_dir", type=SOURCE)
@answering
def kitti(source: Path, out_dir: Path, *, screen: Screen) -> Answer:
    """A KITTI raw drive in folder SOURCE (velodyne_points, oxts), its calibration in it or beside it.

    A scan that cannot be read or has no stamp is counted and left aside, and ends the command with status 2 after
    everything else was written.
    """
    return _cloud_answer(vehicle.convert_kitti(source, out_dir))


@command.command("table")
@click.argument("manifest", type=SOURCE)
@click.argument("out_dir", type=SOURCE)
@click.option("--source-dir", type=SOURCE, metavar="DIR", help="Where the tables stand, if not beside the manifest.")
@answering
def table(manifest: Path, out_dir: Path, source_dir: Path | None, *, screen: Screen) -> Answer:
    """Any tables, as MANIFEST (TOML) describes their columns, units, times and frames."""
    return _answer(vehicle.convert_table(manifest, out_dir, data_dir=source_dir))

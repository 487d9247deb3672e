"""`trigpoint convert`: recorded data becomes vehicles' logs, with truth and anchors beside them."""

import math
from pathlib import Path
from typing import Any

import click
import numpy as np

from trigpoint_cli.output import Answer, JsonObject, Screen, answering
from trigpoint_vehicle import app as vehicle
from trigpoint_vehicle.app import Written
from trigpoint_vehicle.cloud_conversion import WrittenClouds
from trigpoint_vehicle.core.mountings import Mounting, quaternion_of_angles
from trigpoint_vehicle.ros_bags import BagChoice

SOURCE = click.Path(exists=False, path_type=Path)


@click.group("convert", help="Turn recorded data into vehicles' logs.")
def command() -> None:
    """Group of the importers."""


def _answer(written: Written) -> Answer:
    values: JsonObject = {
        "logs": [str(path) for path in written.logs],
        "vehicles": {path.stem: {"log": str(path), "size_bytes": path.stat().st_size} for path in written.logs},
        "truth": None if written.truth is None else str(written.truth),
        "anchors": None if written.anchors is None else str(written.anchors),
    }
    beside = [path for path in (written.truth, written.anchors) if path is not None]
    aside = written.left_aside
    if aside.counts:
        values["left_aside"] = dict(aside.counts)
    return Answer(values, tuple(f"wrote {path}" for path in (*written.logs, *beside)), aside.complaints())


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


def _mounting(_: click.Context, __: click.Parameter, given: tuple[str, ...]) -> dict[str, Mounting]:
    mountings = {}
    for text in given:
        frame, _sign, numbers = text.rpartition("=")
        try:
            x_m, y_m, z_m, roll_deg, pitch_deg, yaw_deg = map(float, numbers.split(","))
        except ValueError:
            raise click.BadParameter(f"{text!r} is not FRAME=X,Y,Z,ROLL,PITCH,YAW in m and degrees") from None
        roll_rad, pitch_rad, yaw_rad = map(math.radians, (roll_deg, pitch_deg, yaw_deg))
        turned = quaternion_of_angles(roll_rad=roll_rad, pitch_rad=pitch_rad, yaw_rad=yaw_rad)
        mountings[frame] = Mounting(np.array([x_m, y_m, z_m]), turned)
    return mountings


def _topics(_: click.Context, __: click.Parameter, given: tuple[str, ...]) -> frozenset[str]:
    return frozenset(given)


@command.command("rosbag")
@click.argument("source", type=SOURCE)
@click.argument("out_dir", type=SOURCE)
@click.option("--vehicle", default="robot", show_default=True, help="The vehicle's name.")
@click.option("--base", default="base_link", show_default=True, help="The frame that is the vehicle's base.")
@click.option("--topic", "topics", multiple=True, callback=_topics, help="Take only these topics (repeatable).")
@click.option(
    "--lidar",
    "mountings",
    multiple=True,
    callback=_mounting,
    metavar="FRAME=X,Y,Z,ROLL,PITCH,YAW",
    help="Where the frame of clouds is in the base, in m and degrees, if not as /tf_static says (repeatable).",
)
@answering
def rosbag(source: Path, out_dir: Path, *, screen: Screen, **chosen: Any) -> Answer:
    """A ROS bag SOURCE: a .bag of ROS 1, or a folder or .mcap of ROS 2, with PointCloud2, NavSatFix, Imu and Odometry.

    A message that cannot be an event is counted and left aside, and ends the command with status 2 after everything
    else was written.
    """
    return _cloud_answer(vehicle.convert_bag(source, out_dir, BagChoice(**chosen)))


@command.command("table")
@click.argument("manifest", type=SOURCE)
@click.argument("out_dir", type=SOURCE)
@click.option("--source-dir", type=SOURCE, metavar="DIR", help="Where the tables stand, if not beside the manifest.")
@answering
def table(manifest: Path, out_dir: Path, source_dir: Path | None, *, screen: Screen) -> Answer:
    """Any tables, as MANIFEST (TOML) describes their columns, units, times and frames."""
    return _answer(vehicle.convert_table(manifest, out_dir, data_dir=source_dir))

"""A bag with a lidar goes through the command line into a data directory; what is wrong in it costs nothing else."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from command_runs.running import trigpoint
from ros_bags.writing import START_NS, VELODYNE, Speaker, points, written_bag
from trigpoint.events.observed import GnssFixReceived
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.mcap_log import McapLog

STEP_NS = 100_000_000


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Three fixes, a sound cloud, one that is damaged, an empty one, and one whose clock jumps."""
    ros = Speaker(2)
    clouds = [
        ros.cloud(points(VELODYNE)),
        ros.cloud(points(VELODYNE), stamp_ns=START_NS + STEP_NS, data=np.zeros(5, dtype=np.uint8)),
        ros.cloud(points(VELODYNE, 0), stamp_ns=START_NS + 2 * STEP_NS),
        ros.cloud(points(VELODYNE, time=[0.0, 0.1, 1.5]), stamp_ns=START_NS + 3 * STEP_NS),
    ]
    fixes = [ros.fix(START_NS + number * STEP_NS) for number in range(3)]
    return written_bag(tmp_path, 2, [*fixes, *clouds])


def test_what_is_wrong_in_a_bag_is_said_and_everything_else_is_in_the_log(bag: Path, tmp_path: Path) -> None:
    told = ("--vehicle", "van", "--lidar", "lidar=0.5,0,2,0,0,90")
    said = trigpoint("convert", "rosbag", bag, tmp_path / "logs", *told, "--json")
    assert (said.status, said.answer["left_aside"]) == (2, {"undecodable": 1})
    taken = trigpoint("ingest", tmp_path / "logs/van.mcap", "--data", tmp_path / "data", "--json")
    assert (taken.status, taken.answer["refused"]) == (2, {"clock jumped in sweep": 1, "empty sweep": 1})
    with closing(McapLog(tmp_path / "data/log")) as log:
        kinds = [type(row.envelope.event) for row in log.read("veh-van", kinds=(GnssFixReceived, PointsScanned))]
        (row,) = log.read("veh-van", kinds=(PointsScanned,))
    assert sorted(kind.__name__ for kind in kinds) == ["GnssFixReceived"] * 3 + ["PointsScanned"]
    sweep = row.envelope.event
    assert isinstance(sweep, PointsScanned)
    assert sweep.sensor_position_m.tolist() == [0.5, 0.0, 2.0]
    assert sweep.sensor_orientation == pytest.approx([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])

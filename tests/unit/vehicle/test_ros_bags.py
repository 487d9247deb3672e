"""Bags of ROS 1 and ROS 2 become vehicles' logs; what cannot be an event is counted, and costs nothing else."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from ros_bags.writing import LIVOX, OUSTER, START_NS, VELODYNE, Said, Speaker, points, written_bag
from trigpoint.errors import InputError
from trigpoint.events.codec import Event, decode
from trigpoint.events.observed import GnssFixReceived, ImuMeasured, VehicleDescribed, WheelSpeedMeasured
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.vehicle_log import read_vehicle_log
from trigpoint_vehicle.app import convert_bag
from trigpoint_vehicle.cloud_conversion import WrittenClouds
from trigpoint_vehicle.core.mountings import AT_BASE, Mounting
from trigpoint_vehicle.ros_bags import BagChoice

LIDAR_AT_BASE = BagChoice(vehicle="robot", mountings={"lidar": AT_BASE})
STEP_NS = 100_000_000
G_MPS2 = 9.81


@pytest.fixture(params=[1, 2], ids=["ROS 1", "ROS 2"])
def ros(request: pytest.FixtureRequest) -> Speaker:
    return Speaker(request.param)


def converted(
    folder: Path, ros: Speaker, said: Sequence[Said], choice: BagChoice = LIDAR_AT_BASE
) -> tuple[WrittenClouds, list[Event]]:
    written = convert_bag(written_bag(folder, ros.version, said), folder / "out", choice)
    return written, [decode(one.schema_name, one.payload) for one in read_vehicle_log(written.log)]


def sweep_of(events: Sequence[Event]) -> PointsScanned:
    (sweep,) = (event for event in events if isinstance(event, PointsScanned))
    return sweep


def test_a_velodynes_cloud_keeps_points_intensity_ring_and_time(tmp_path: Path, ros: Speaker) -> None:
    rows = points(VELODYNE, intensity=[7, 8, 9], ring=[0, 5, 15], time=[-0.05, 0.0, 0.03125])
    sweep = sweep_of(converted(tmp_path, ros, [ros.fix(), ros.cloud(rows)])[1])
    assert sweep.point_m.tolist() == [[1.0, 2.0, 3.0]] * 3
    assert (sweep.intensity.tolist(), sweep.ring.tolist()) == ([7, 8, 9], [0, 5, 15])
    assert sweep.offset_ns.tolist() == [-50_000_001, 0, 31_250_000]  # -0.05 is no float32


def test_an_ousters_cloud_keeps_reflectivity_and_nanoseconds(tmp_path: Path, ros: Speaker) -> None:
    rows = points(OUSTER, t=[0, 50_000_000, 99_999_999], reflectivity=300, intensity=1.0, ring=[0, 64, 127])
    sweep = sweep_of(converted(tmp_path, ros, [ros.fix(), ros.cloud(rows)])[1])
    assert sweep.offset_ns.tolist() == [0, 50_000_000, 99_999_999]
    assert (sweep.intensity.tolist(), sweep.ring.tolist()) == ([300.0] * 3, [0, 64, 127])


def test_a_livoxs_cloud_keeps_its_offsets(tmp_path: Path, ros: Speaker) -> None:
    sweep = sweep_of(converted(tmp_path, ros, [ros.fix(), ros.cloud(points(LIVOX, offset_time=[0, 5, 9]))])[1])
    assert sweep.offset_ns.tolist() == [0, 5, 9]


def test_points_at_the_lidar_itself_did_not_come_back(tmp_path: Path, ros: Speaker) -> None:
    rows = points(LIVOX, x=[0, 1, math.nan], y=[0, 1, math.nan], z=[0, 1, math.nan])
    sweep = sweep_of(converted(tmp_path, ros, [ros.fix(), ros.cloud(rows)])[1])
    assert np.isnan(sweep.point_m).all(axis=1).tolist() == [True, False, True]


def test_rows_that_are_filled_up_are_read_without_the_filling(tmp_path: Path, ros: Speaker) -> None:
    rows = points(LIVOX, 4, x=[1, 2, 3, 4])
    data = b"".join(rows[start : start + 2].tobytes() + bytes(6) for start in (0, 2))
    filled = ros.cloud(
        rows, height=2, width=2, row_step=2 * LIVOX.itemsize + 6, data=np.frombuffer(data, dtype=np.uint8)
    )
    sweep = sweep_of(converted(tmp_path, ros, [ros.fix(), filled])[1])
    assert sweep.point_m[:, 0].tolist() == [1.0, 2.0, 3.0, 4.0]


def test_a_big_endian_cloud_is_read(tmp_path: Path, ros: Speaker) -> None:
    rows = points(LIVOX, x=[1, 2, 3])
    swapped = np.frombuffer(rows.astype(LIVOX.newbyteorder(">")).tobytes(), dtype=np.uint8)
    sweep = sweep_of(converted(tmp_path, ros, [ros.fix(), ros.cloud(rows, is_bigendian=True, data=swapped)])[1])
    assert sweep.point_m[:, 0].tolist() == [1.0, 2.0, 3.0]


def test_the_lidar_is_where_the_bags_own_transforms_lead(tmp_path: Path, ros: Speaker) -> None:
    half = math.sqrt(0.5)
    said = [
        ros.mounting("mast", "base_link", (1.0, 0.0, 1.5), (0.0, 0.0, half, half)),  # turned to the left
        ros.mounting("lidar", "mast", (0.2, 0.0, 0.1), (0.0, 0.0, 0.0, 1.0)),
        ros.fix(),
        ros.cloud(points(LIVOX)),
    ]
    sweep = sweep_of(converted(tmp_path, ros, said, BagChoice(vehicle="robot", mountings={}))[1])
    assert sweep.sensor_position_m == pytest.approx([1.0, 0.2, 1.6])
    assert sweep.sensor_orientation == pytest.approx([0.0, 0.0, half, half])


def test_the_antenna_is_where_the_bags_own_transforms_lead(tmp_path: Path, ros: Speaker) -> None:
    said = [ros.mounting("gps", "base_link", (0.5, -0.25, 1.0), (0.0, 0.0, 0.0, 1.0)), ros.fix()]
    (described, *_) = converted(tmp_path, ros, said)[1]
    assert isinstance(described, VehicleDescribed)
    assert (described.antenna_x_m, described.antenna_y_m) == (0.5, -0.25)


def test_a_mounting_that_is_given_goes_before_the_bags(tmp_path: Path, ros: Speaker) -> None:
    given = Mounting(np.array([0.0, 0.0, 2.0]), AT_BASE.orientation)
    said = [ros.mounting("lidar", "base_link", (1, 1, 1), (0, 0, 0, 1)), ros.fix(), ros.cloud(points(LIVOX))]
    sweep = sweep_of(converted(tmp_path, ros, said, BagChoice(vehicle="robot", mountings={"lidar": given}))[1])
    assert sweep.sensor_position_m.tolist() == [0.0, 0.0, 2.0]


def test_a_lidar_whose_place_nobody_says_is_refused_with_what_to_do(tmp_path: Path, ros: Speaker) -> None:
    with pytest.raises(InputError, match="frame 'lidar' of the clouds: .* give --lidar lidar=X,Y,Z,ROLL,PITCH,YAW"):
        converted(tmp_path, ros, [ros.fix(), ros.cloud(points(LIVOX))], BagChoice(vehicle="robot", mountings={}))


def test_clouds_without_a_path_are_refused(tmp_path: Path, ros: Speaker) -> None:
    with pytest.raises(InputError, match="clouds without a path: neither sensor_msgs/msg/NavSatFix nor"):
        converted(tmp_path, ros, [ros.cloud(points(LIVOX))])


def test_events_stand_in_order_of_their_own_stamps(tmp_path: Path, ros: Speaker) -> None:
    said = [ros.fix(START_NS + n * STEP_NS // 2) for n in range(4)]
    said.insert(3, ros.cloud(points(LIVOX), stamp_ns=START_NS + 1))  # which arrives 0.1 s later
    written, _ = converted(tmp_path, ros, said)
    stamps = [one.stamp_ns for one in read_vehicle_log(written.log)]
    assert stamps == sorted(stamps)


def test_a_cloud_without_a_stamp_has_the_time_it_arrived_at(tmp_path: Path, ros: Speaker) -> None:
    cloud = ros.cloud(points(LIVOX), stamp_ns=0)
    late = Said(topic=cloud.topic, kind=cloud.kind, message=cloud.message, arrived_ns=START_NS + 5)
    written, _ = converted(tmp_path, ros, [ros.fix(), late])
    assert [one.stamp_ns - START_NS for one in read_vehicle_log(written.log)] == [0, 0, 5]


def test_the_rate_of_turn_is_about_the_vertical_however_the_imu_is_mounted(tmp_path: Path, ros: Speaker) -> None:
    said = [ros.imu(START_NS, rate=(0.0, 0.25, 0.5), force=(0.0, G_MPS2, 0.0)), ros.fix()]  # its y axis is up
    (imu,) = (event for event in converted(tmp_path, ros, said)[1] if isinstance(event, ImuMeasured))
    assert (imu.yaw_rate_radps, math.isnan(imu.acceleration_x_mps2)) == (0.25, True)


def test_a_level_imu_says_what_the_vehicle_accelerates(tmp_path: Path, ros: Speaker) -> None:
    said = [ros.imu(START_NS, rate=(0.0, 0.0, 0.5), force=(0.0, 0.0, G_MPS2)), ros.fix()]
    (imu,) = (event for event in converted(tmp_path, ros, said)[1] if isinstance(event, ImuMeasured))
    assert (imu.yaw_rate_radps, imu.acceleration_x_mps2) == (0.5, 0.0)


def test_an_imu_without_gravity_is_refused_with_its_mean(tmp_path: Path, ros: Speaker) -> None:
    said = [ros.imu(START_NS, rate=(0.0, 0.0, 0.5), force=(0.0, 0.0, 0.1)), ros.fix()]
    with pytest.raises(InputError, match="mean acceleration is 0.1 m/s² of 1 messages: between 8 and 11.6"):
        converted(tmp_path, ros, said)


def test_the_sigma_of_a_fix_is_that_of_its_worse_axis(tmp_path: Path, ros: Speaker) -> None:
    (fix,) = (event for event in converted(tmp_path, ros, [ros.fix()])[1] if isinstance(event, GnssFixReceived))
    assert (fix.lat_deg, fix.sigma_m) == (-33.9, 2.0)


def test_a_fix_of_unknown_covariance_declares_no_sigma(tmp_path: Path, ros: Speaker) -> None:
    said = [ros.fix(position_covariance_type=0)]
    (fix,) = (event for event in converted(tmp_path, ros, said)[1] if isinstance(event, GnssFixReceived))
    assert math.isnan(fix.sigma_m)


@pytest.mark.parametrize("lost", [{"status": -1}, {"latitude": math.nan}], ids=["status", "nan"])
def test_a_receiver_without_a_fix_is_counted_and_left_aside(
    tmp_path: Path, ros: Speaker, lost: dict[str, float]
) -> None:
    said = [ros.fix(START_NS, **lost), ros.fix(START_NS + STEP_NS)]  # type: ignore[arg-type]  # status is whole
    written, _ = converted(tmp_path, ros, said)
    assert (written.counts, dict(written.left_aside.counts)) == ({"GnssFixReceived": 1}, {"no fix": 1})


def test_a_cloud_that_does_not_fit_its_layout_is_left_aside_and_the_next_is_taken(tmp_path: Path, ros: Speaker) -> None:
    bad = ros.cloud(points(VELODYNE), data=np.zeros(65, dtype=np.uint8))
    written, _ = converted(tmp_path, ros, [ros.fix(), bad, ros.cloud(points(VELODYNE), stamp_ns=START_NS + STEP_NS)])
    assert (written.counts["PointsScanned"], dict(written.left_aside.counts)) == (1, {"undecodable": 1})
    assert "65 bytes in 1 rows of 66 bytes, 3 points of 22 bytes each" in written.left_aside.complaints()[0]


def test_a_cloud_in_another_frame_than_the_first_is_left_aside(tmp_path: Path, ros: Speaker) -> None:
    other = ros.cloud(points(LIVOX), frame="trailer", stamp_ns=START_NS + STEP_NS)
    written, _ = converted(tmp_path, ros, [ros.fix(), ros.cloud(points(LIVOX)), other])
    assert dict(written.left_aside.counts) == {"unknown frame": 1}


def test_an_empty_cloud_is_left_to_ingest(tmp_path: Path, ros: Speaker) -> None:
    sweep = sweep_of(converted(tmp_path, ros, [ros.fix(), ros.cloud(points(LIVOX, 0))])[1])
    assert len(sweep.point_m) == 0


def test_two_receivers_are_refused_until_one_is_chosen(tmp_path: Path, ros: Speaker) -> None:
    said = [ros.fix(), ros.fix(topic="/other")]
    with pytest.raises(InputError, match="NavSatFix on /fix, /other: choose one with --topic"):
        converted(tmp_path, ros, said)
    chosen = BagChoice(vehicle="robot", topics=frozenset({"/other"}), mountings={})
    source = tmp_path / ("drive.bag" if ros.version == 1 else "drive")
    assert convert_bag(source, tmp_path / "out", chosen).counts == {"GnssFixReceived": 1}


def test_a_topic_that_is_not_there_is_refused_with_those_that_are(tmp_path: Path, ros: Speaker) -> None:
    choice = BagChoice(vehicle="robot", topics=frozenset({"/gps"}), mountings={})
    with pytest.raises(InputError, match="no topic /gps; there are /fix"):
        converted(tmp_path, ros, [ros.fix()], choice)


def test_one_mcap_of_a_ros_2_bag_is_a_bag(tmp_path: Path) -> None:
    folder = written_bag(tmp_path, 2, [Speaker(2).fix()])
    (file,) = folder.glob("*.mcap")
    assert convert_bag(file, tmp_path / "out", LIDAR_AT_BASE).counts == {"GnssFixReceived": 1}


@pytest.mark.parametrize("name", ["missing.bag", "rubbish.bag", "rubbish.mcap", "folder"])
def test_what_is_no_bag_is_refused_by_name(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder").mkdir()
    for rubbish in ("rubbish.bag", "rubbish.mcap"):
        (tmp_path / rubbish).write_bytes(b"no bag at all, but some bytes")
    with pytest.raises(InputError, match=name):
        convert_bag(tmp_path / name, tmp_path / "out", LIDAR_AT_BASE)


@pytest.mark.data
def test_a_recorded_bag_becomes_fixes_inertial_data_and_wheels(recorded_drives: Path, tmp_path: Path) -> None:
    written = convert_bag(recorded_drives / "bags/test1.bag", tmp_path, LIDAR_AT_BASE)
    counts = {GnssFixReceived: 989, ImuMeasured: 11865, WheelSpeedMeasured: 3952}
    assert written.counts == {kind.__name__: count for kind, count in counts.items()}
    assert written.left_aside.complaints() == ()


@pytest.mark.data
def test_a_recorded_imu_on_its_side_turns_as_the_wheels_do(recorded_drives: Path, tmp_path: Path) -> None:
    written = convert_bag(recorded_drives / "bags/test1.bag", tmp_path, LIDAR_AT_BASE)
    rows = [(one.stamp_ns, decode(one.schema_name, one.payload)) for one in read_vehicle_log(written.log)]
    imu = np.array([(t, event.yaw_rate_radps) for t, event in rows if isinstance(event, ImuMeasured)])
    wheels = np.array([(t, event.yaw_rate_radps) for t, event in rows if isinstance(event, WheelSpeedMeasured)])
    turned = np.interp(imu[:, 0], wheels[:, 0], wheels[:, 1])
    slope = float(turned @ imu[:, 1] / (turned @ turned))
    assert slope == pytest.approx(1.0, abs=0.05)  # of the wheels' own scale error

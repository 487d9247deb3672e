"""Scans that a manifest names stand in a vehicle's log among what its tables say."""

from pathlib import Path

import numpy as np
import pytest

from las_files.writing import CHUNK_SIZE_AT, las, laszip_record_at, overwritten, truncated
from trigpoint.errors import InputError
from trigpoint.events.codec import decode
from trigpoint.events.observed import GnssFixReceived, VehicleDescribed
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.vehicle_log import read_vehicle_log
from trigpoint_vehicle.app import Written, convert_table

START_NS = 1_700_000_000_000_000_000
MANIFEST = """
[[vehicle]]
name = "van"
file = "fixes.csv"
fixes = {{ time = {{ column = "t_ns", unit = "ns" }}, lat = "lat", lon = "lon" }}

[vehicle.sweeps]
sensor = "roof"
position_m = [0.4, 0.0, 1.9]
yaw_deg = 90.0
{sweeps}
"""
LISTED = 'file = "scans/*.bin"\ntime = { column = "stem", unit = "ns" }'
POINTS = np.array([[1.0, 2.0, 3.0, 0.5], [4.0, 5.0, 6.0, 0.25]], dtype=np.float32)


def drive(folder: Path, sweeps: str = LISTED) -> Path:
    """Two fixes, and a scan before, between and after them."""
    (folder / "scans").mkdir()
    for offset_ns in (0, 10, 20):
        (folder / f"scans/{START_NS + offset_ns}.bin").write_bytes(POINTS.tobytes())
    (folder / "fixes.csv").write_text(f"t_ns,lat,lon\n{START_NS + 5},-33.9,151.2\n{START_NS + 15},-33.9,151.2\n")
    manifest = folder / "drive.toml"
    manifest.write_text(MANIFEST.format(sweeps=sweeps))
    return manifest


def converted(manifest: Path) -> tuple[Written, list[tuple[int, object]]]:
    written = convert_table(manifest, manifest.parent / "out")
    messages = read_vehicle_log(written.logs[0])
    return written, [(one.stamp_ns - START_NS, decode(one.schema_name, one.payload)) for one in messages]


def sweeps_of(manifest: Path) -> list[PointsScanned]:
    return [event for _, event in converted(manifest)[1] if isinstance(event, PointsScanned)]


def test_scans_listed_by_a_pattern_stand_among_the_fixes_in_order_of_time(tmp_path: Path) -> None:
    _, rows = converted(drive(tmp_path))
    kinds = [VehicleDescribed, PointsScanned, GnssFixReceived, PointsScanned, GnssFixReceived, PointsScanned]
    assert [(stamp_ns, type(event)) for stamp_ns, event in rows] == list(zip([0, 0, 5, 10, 15, 20], kinds, strict=True))


def test_messages_are_numbered_without_gaps(tmp_path: Path) -> None:
    written, _ = converted(drive(tmp_path))
    assert [one.identity.sequence for one in read_vehicle_log(written.logs[0])] == list(range(6))


def test_the_lidar_stands_as_the_manifest_says(tmp_path: Path) -> None:
    sweep = sweeps_of(drive(tmp_path))[0]
    assert (sweep.sensor, sweep.sensor_position_m.tolist()) == ("roof", [0.4, 0.0, 1.9])
    assert sweep.sensor_orientation == pytest.approx([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])


def pcd_drive(folder: Path, *viewpoints: str, mounted: str = "") -> Path:
    """A drive whose scans are PCD files with these lines VIEWPOINT, its lidar mounted as said, if at all."""
    header = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nVIEWPOINT {}\nDATA ascii\n1 2 3\n"
    manifest = drive(folder, 'file = "seen/*.pcd"\ntime = { column = "stem", unit = "ns" }')
    manifest.write_text(manifest.read_text().replace("position_m = [0.4, 0.0, 1.9]\nyaw_deg = 90.0\n", mounted))
    (folder / "seen").mkdir()
    for number, viewpoint in enumerate(viewpoints):
        (folder / f"seen/{START_NS + number}.pcd").write_text(header.format(viewpoint))
    return manifest


def test_without_a_place_in_the_manifest_each_pcd_files_viewpoint_is_its_lidars(tmp_path: Path) -> None:
    sweeps = sweeps_of(pcd_drive(tmp_path, "0.5 0 1.5 1 0 0 0", "0.5 0 1.6 0 0 0 1"))
    assert [one.sensor_position_m.tolist() for one in sweeps] == [[0.5, 0.0, 1.5], [0.5, 0.0, 1.6]]
    assert [one.sensor_orientation.tolist() for one in sweeps] == [[0, 0, 0, 1], [0, 0, 1, 0]]
    assert sweeps[1].point_m.tolist() == [[1.0, 2.0, 3.0]]  # in the sensor's frame, as they stand


def test_a_place_in_the_manifest_goes_before_the_files_viewpoints(tmp_path: Path) -> None:
    (sweep,) = sweeps_of(pcd_drive(tmp_path, "0.5 0 1.5 nan 0 0 0", mounted="position_m = [0.4, 0.0, 1.9]\n"))
    assert (sweep.sensor_position_m.tolist(), sweep.sensor_orientation.tolist()) == ([0.4, 0.0, 1.9], [0, 0, 0, 1])


def test_a_pcd_file_whose_viewpoint_is_no_place_is_left_aside_and_the_next_is_written(tmp_path: Path) -> None:
    written, rows = converted(pcd_drive(tmp_path, "0 0 1 2 0 0 0", "0.5 0 1.5 1 0 0 0"))
    assert sum(isinstance(event, PointsScanned) for _, event in rows) == 1
    assert "has a quaternion of length 2, limit 1 within 0.001" in written.left_aside.complaints()[0]


def test_files_that_cannot_say_where_their_lidar_is_need_a_place_in_the_manifest(tmp_path: Path) -> None:
    manifest = drive(tmp_path)
    manifest.write_text(manifest.read_text().replace("position_m = [0.4, 0.0, 1.9]\nyaw_deg = 90.0\n", ""))
    with pytest.raises(InputError, match=r"sensor 'roof' need position_m: scans/\d+.bin does not say"):
        convert_table(manifest, tmp_path / "out")


def test_a_lidar_that_is_turned_needs_a_place(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="yaw_deg without position_m"):
        convert_table(pcd_drive(tmp_path, "0 0 1 1 0 0 0", mounted="yaw_deg = 90.0\n"), tmp_path / "out")


def test_a_table_may_name_the_scans_and_their_times(tmp_path: Path) -> None:
    (tmp_path / "stamps.csv").write_text(f"when,cloud\n1700000000.5,scans/{START_NS}.bin\n")
    manifest = drive(tmp_path, 'file = "stamps.csv"\ntime = "when"\nscan = "cloud"')
    stamps = [stamp_ns for stamp_ns, event in converted(manifest)[1] if isinstance(event, PointsScanned)]
    assert stamps == [500_000_000]


def test_a_scan_that_is_missing_is_left_aside_and_the_others_are_written(tmp_path: Path) -> None:
    (tmp_path / "stamps.csv").write_text(f"t,scan\n1,scans/{START_NS}.bin\n2,scans/gone.bin\n")
    written, rows = converted(drive(tmp_path, 'file = "stamps.csv"\ntime = "t"'))
    assert sum(isinstance(event, PointsScanned) for _, event in rows) == 1
    assert dict(written.left_aside.counts) == {"unreadable scan": 1}
    assert "gone.bin: cannot be read" in written.left_aside.complaints()[0]


@pytest.mark.parametrize(
    ("name", "content", "why"),
    [
        ("a.bin", bytes(17), "17 bytes are no whole number of points of 16 bytes"),
        ("a.pcd", b"nothing", "no PCD file"),
        ("a.laz", b"nothing", "no LAS or LAZ file that can be read"),
        ("a.xyz", b"1 2 3", ".xyz is none of .pcd, .bin, .las, .laz"),
    ],
)
def test_a_file_that_holds_no_points_is_left_aside(tmp_path: Path, name: str, content: bytes, why: str) -> None:
    (tmp_path / name).write_bytes(content)
    (tmp_path / "stamps.csv").write_text(f"t,scan\n1,{name}\n")
    written, _ = converted(drive(tmp_path, 'file = "stamps.csv"\ntime = "t"'))
    assert why in written.left_aside.complaints()[0]


def test_a_pcd_file_without_z_is_left_aside_with_its_reason(tmp_path: Path) -> None:
    (tmp_path / "a.pcd").write_text("FIELDS x y\nSIZE 4 4\nTYPE F F\nWIDTH 1\nHEIGHT 1\nDATA ascii\n1 2\n")
    (tmp_path / "stamps.csv").write_text("t,scan\n1,a.pcd\n")
    written, _ = converted(drive(tmp_path, 'file = "stamps.csv"\ntime = "t"'))
    assert dict(written.left_aside.counts) == {"undecodable": 1}


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_a_las_files_points_are_taken_from_its_origin_with_their_times(tmp_path: Path, suffix: str) -> None:
    las(tmp_path / f"a.{suffix}", time_s=(1000.0, 1000.25))
    (tmp_path / "stamps.csv").write_text(f"t,scan\n1,a.{suffix}\n")
    told = 'file = "stamps.csv"\ntime = "t"\norigin_m = [652000, 6862000, 0]\npoint_times = "gps_time"'
    (sweep,) = sweeps_of(drive(tmp_path, told))
    assert sweep.point_m.tolist() == [[1.5, 3.0, 5.0], [2.5, 4.0, 6.0]]
    assert (sweep.intensity.tolist(), sweep.offset_ns.tolist()) == ([700.0, 800.0], [0, 250_000_000])


def test_damaged_laz_files_are_left_aside_by_name_and_the_good_ones_among_them_are_written(tmp_path: Path) -> None:
    names = ["cut", "good", "flipped", "last"]
    cut, _, flipped, _ = (las(tmp_path / f"{name}.laz") for name in names)
    truncated(cut, lost=40)
    overwritten(flipped, laszip_record_at(flipped) + CHUNK_SIZE_AT + 3, 0x80, size=1)  # a bit: 2**31 points a chunk
    rows = "".join(f"{second},{name}.laz\n" for second, name in enumerate(names, start=1))
    (tmp_path / "stamps.csv").write_text(f"t,scan\n{rows}")
    written, events = converted(drive(tmp_path, 'file = "stamps.csv"\ntime = "t"\norigin_m = [652000, 6862000, 0]'))
    sweeps = [event for _, event in events if isinstance(event, PointsScanned)]
    assert [one.point_m[0].tolist() for one in sweeps] == [[1.5, 3.0, 5.0]] * 2
    assert dict(written.left_aside.counts) == {"unreadable scan": 2}
    assert "cut.laz: its table of chunks is at byte" in written.left_aside.complaints()[0]


def test_a_las_file_that_takes_minutes_is_no_scan_of_its_points_times(tmp_path: Path) -> None:
    las(tmp_path / "a.las", time_s=(1000.0, 1060.0))
    (tmp_path / "stamps.csv").write_text("t,scan\n1,a.las\n")
    told = 'file = "stamps.csv"\ntime = "t"\npoint_times = "gps_time"'
    written, _ = converted(drive(tmp_path, told))
    assert "a point 60 s after the first of its scan, limit 2.147 s" in written.left_aside.complaints()[0]


def test_a_pattern_without_files_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no file scans/\*.las"):
        convert_table(drive(tmp_path, LISTED.replace(".bin", ".las")), tmp_path / "out")


def test_scans_without_a_path_are_refused(tmp_path: Path) -> None:
    manifest = drive(tmp_path)
    text = "\n".join(line for line in manifest.read_text().splitlines() if not line.startswith("fixes"))
    manifest.write_text(text)
    with pytest.raises(InputError, match="vehicle 'van' has sweeps without a path"):
        convert_table(manifest, tmp_path / "out")


def test_a_file_name_that_is_no_time_is_refused_with_its_row(tmp_path: Path) -> None:
    manifest = drive(tmp_path)
    (tmp_path / "scans/first.bin").write_bytes(b"")
    with pytest.raises(InputError, match="row 5: stem is 'first', not a time"):
        convert_table(manifest, tmp_path / "out")


@pytest.mark.data
def test_an_airborne_tile_is_read_whole(recorded_drives: Path, tmp_path: Path) -> None:
    tile = recorded_drives / "ign_lidar_hd/test_data_77055_627760_LA93_IGN69.laz"
    (tmp_path / "stamps.csv").write_text(f"t,scan\n1,{tile}\n")
    manifest = drive(tmp_path, 'file = "stamps.csv"\ntime = "t"\norigin_m = [770575, 6277575, 0]')
    (sweep,) = sweeps_of(manifest)
    assert sweep.point_m.shape == (60_653, 3)
    assert np.abs(sweep.point_m[:, :2]).max() <= 25.1  # m: a tile of 50 m about its middle

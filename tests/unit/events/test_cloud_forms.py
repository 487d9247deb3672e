import contextlib
import math
from dataclasses import replace

import numpy as np
import pytest
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from hypothesis import given, settings
from hypothesis import strategies as st

from event_examples.any_event import same_event
from event_examples.one_each import EVENTS
from trigpoint.errors import EventRejected
from trigpoint.events.cloud_forms import POINT, cloud_event, cloud_message
from trigpoint.events.scanned import PointsScanned

SWEEP = next(event for event in EVENTS if isinstance(event, PointsScanned))
F32, F64 = PackedElementField.FLOAT32, PackedElementField.FLOAT64
U8, U16, U32, I8 = (getattr(PackedElementField, name) for name in ("UINT8", "UINT16", "UINT32", "INT8"))
NUMPY = {F32: "<f4", F64: "<f8", U8: "<u1", U16: "<u2", U32: "<u4", I8: "<i1"}
XYZ = (("x", F32, 1.0), ("y", F32, 2.0), ("z", F32, 3.0))
STAMP_NS = 1_700_000_000_000_000_000


def cloud(*columns: tuple[str, int, float], count: int = 2, padding: int = 0, stride: int = 0) -> PointCloud:
    """A foreign cloud: each point has the same values, the fields stand one behind the other."""
    layout = np.dtype([(f"{index}", NUMPY[kind]) for index, (_, kind, _) in enumerate(columns)])
    rows = np.array([tuple(value for _, _, value in columns)] * count, dtype=layout)
    data = b"".join(row.tobytes() + bytes(padding) for row in rows)
    offsets = [layout.fields[str(index)][1] for index in range(len(columns))]  # type: ignore[index]
    fields = [
        PackedElementField(name=name, offset=offset, type=kind)  # type: ignore[arg-type]  # an enum's number
        for offset, (name, kind, _) in zip(offsets, columns, strict=True)
    ]
    return PointCloud(point_stride=stride or layout.itemsize + padding, fields=fields, data=data)


def refused(message: PointCloud) -> str:
    with pytest.raises(EventRejected) as caught:
        cloud_event(message)
    assert caught.value.reason == "undecodable"
    return caught.value.detail


def test_a_sweep_comes_back_exactly() -> None:
    assert same_event(cloud_event(cloud_message(SWEEP)), SWEEP)


def test_a_point_takes_22_bytes_and_foxglove_knows_its_fields() -> None:
    message = cloud_message(SWEEP)
    assert (message.point_stride, len(message.data)) == (22, 44)
    assert [field.name for field in message.fields] == ["x", "y", "z", "intensity", "offset_ns", "ring"]


def test_the_written_fields_stand_where_they_are_said_to() -> None:
    offsets = {field.name: field.offset for field in cloud_message(SWEEP).fields}
    fields = dict(POINT.fields or {})
    assert [offsets[name] for name in ("x", "intensity", "offset_ns", "ring")] == [
        fields[name][1] for name in ("xyz", "intensity", "offset_ns", "ring")
    ]


def test_the_sensor_is_the_frame_and_its_place_the_pose() -> None:
    message = cloud_message(SWEEP)
    assert (message.frame_id, message.pose.position.z, message.pose.orientation.w) == ("roof", 1.9, 0.8)


def test_a_cloud_without_pose_was_measured_at_the_base() -> None:
    event = cloud_event(cloud(*XYZ))
    assert event.sensor_position_m.tolist() == [0.0, 0.0, 0.0]
    assert event.sensor_orientation.tolist() == [0.0, 0.0, 0.0, 1.0]


def test_an_orientation_of_zeros_is_not_mended() -> None:
    sweep = replace(SWEEP, sensor_orientation=np.zeros(4))
    assert cloud_event(cloud_message(sweep)).sensor_orientation.tolist() == [0.0] * 4


def test_a_bare_cloud_has_no_intensity_offset_or_ring() -> None:
    event = cloud_event(cloud(*XYZ))
    assert (event.intensity.tolist(), event.offset_ns.tolist(), event.ring.tolist()) == ([0, 0], [0, 0], [0, 0])


def test_doubles_in_any_order_with_padding_are_read() -> None:
    event = cloud_event(cloud(("z", F64, 3.0), ("intensity", U8, 200.0), ("y", F64, 2.0), ("x", F64, 1.0), padding=7))
    assert event.point_m.tolist() == [[1.0, 2.0, 3.0]] * 2
    assert event.intensity.tolist() == [200.0] * 2


def test_velodyne_times_are_seconds_after_the_stamp() -> None:
    event = cloud_event(cloud(*XYZ, ("intensity", F32, 9.0), ("ring", U16, 63.0), ("time", F32, -0.0625)))
    assert (event.offset_ns.tolist(), event.ring.tolist()) == ([-62_500_000] * 2, [63, 63])


def test_ouster_times_are_nanoseconds_and_its_reflectivity_is_corrected_for_range() -> None:
    columns = (("intensity", F32, 9.0), ("t", U32, 99_999_999.0), ("reflectivity", U16, 500.0), ("ring", U8, 7.0))
    event = cloud_event(cloud(*XYZ, *columns))
    assert (event.offset_ns.tolist(), event.intensity.tolist(), event.ring.tolist()) == (
        [99_999_999] * 2,
        [500.0] * 2,
        [7, 7],
    )


def test_livox_times_are_nanoseconds() -> None:
    assert cloud_event(cloud(*XYZ, ("offset_time", U32, 5_000.0))).offset_ns.tolist() == [5_000] * 2


@pytest.mark.parametrize("timestamp", [1_700_000_000.05, 1_700_000_000_050_000_000.0])
def test_absolute_times_in_seconds_or_nanoseconds_are_taken_from_the_clouds_stamp(timestamp: float) -> None:
    message = cloud(*XYZ, ("timestamp", F64, timestamp))
    message.timestamp.FromNanoseconds(STAMP_NS)
    assert cloud_event(message).offset_ns[0] == pytest.approx(50_000_000, abs=256)  # ns: a float64's last place


def test_absolute_times_without_a_stamp_are_refused() -> None:
    assert "the cloud has stamp None" in refused(cloud(*XYZ, ("timestamp", F64, 1_700_000_000.0)))


def test_a_point_without_a_time_was_measured_at_the_stamp() -> None:
    assert cloud_event(cloud(*XYZ, ("time", F32, math.nan))).offset_ns.tolist() == [0, 0]


def test_a_time_too_far_away_is_refused_with_its_distance_and_the_limit() -> None:
    assert refused(cloud(*XYZ, ("time", F32, 4.0))) == "time: a point 4 s after the stamp, limit 2.147 s"


def test_a_cloud_without_z_is_refused() -> None:
    assert refused(cloud(*XYZ[:2])) == "field 'z' is missing: float32 or float64 is needed"


def test_whole_numbers_as_coordinates_are_refused() -> None:
    assert "field 'z' is int8" in refused(cloud(*XYZ[:2], ("z", I8, 3.0)))


def test_a_field_past_the_stride_is_refused() -> None:
    message = cloud(*XYZ)
    message.fields[2].offset = 9
    assert refused(message) == "field 'z' ends at byte 13 of a point of 12 bytes"


def test_a_length_that_is_no_whole_number_of_points_is_refused() -> None:
    message = cloud(*XYZ)
    message.data += b"\x00"
    assert refused(message) == "25 bytes are no whole number of points of 12 bytes"


def test_points_of_no_bytes_are_refused() -> None:
    assert refused(PointCloud(data=b"1")) == "points of 0 fields and 0 bytes: up to 64, and 1 to 1024"


def test_points_of_too_many_bytes_are_refused() -> None:
    assert "points of 3 fields and 4294967295 bytes" in refused(cloud(*XYZ, stride=2**32 - 1))


any_field = st.builds(
    PackedElementField,
    name=st.sampled_from(["x", "y", "z", "intensity", "ring", "t", "timestamp", ""]) | st.text(max_size=3),
    offset=st.integers(0, 40) | st.integers(0, 2**32 - 1),
    type=st.integers(-1, 10),
)
all_axes = st.just([PackedElementField(name=name, offset=0, type=F32) for name in ("x", "y", "z")])


@given(
    fields=st.tuples(all_axes | st.just([]), st.lists(any_field, max_size=5)).map(lambda parts: [*parts[0], *parts[1]]),
    stride=st.integers(0, 40) | st.integers(0, 2**32 - 1),
    data=st.binary(max_size=80),
    seconds=st.none() | st.integers(-(2**63), 2**63 - 1),
)
@settings(max_examples=300, deadline=None, derandomize=True)
def test_any_cloud_is_a_sweep_or_rejected(
    fields: list[PackedElementField], stride: int, data: bytes, seconds: int | None
) -> None:
    message = PointCloud(fields=fields, point_stride=stride, data=data)
    if seconds is not None:
        message.timestamp.seconds = seconds
    with contextlib.suppress(EventRejected):  # and nothing else
        assert isinstance(cloud_event(message), PointsScanned)


def test_a_field_named_twice_is_refused() -> None:
    assert "stands twice in x, y, z, x" in refused(cloud(*XYZ, ("x", F32, 1.0)))


def test_a_field_of_an_unknown_type_is_refused() -> None:
    message = cloud(*XYZ)
    message.fields.add(name="colour", offset=0, type=99)
    assert refused(message) == "field 'colour' has type 99: 1 to 8 known"


@pytest.mark.parametrize(("kind", "value"), [(F32, 70_000.0), (F32, math.nan), (I8, -1.0)])
def test_a_ring_that_is_no_small_whole_number_is_refused(kind: int, value: float) -> None:
    assert "is outside 0 to 65535" in refused(cloud(*XYZ, ("ring", kind, value)))


def test_an_array_of_another_type_cannot_be_written() -> None:
    sweep = replace(SWEEP, intensity=SWEEP.intensity.astype(np.float64))
    with pytest.raises(EventRejected, match="intensity is float64 of shape .2,., expected float32"):
        cloud_message(sweep)


def test_columns_of_unequal_length_cannot_be_written() -> None:
    with pytest.raises(EventRejected, match="ring is uint16 of shape .1,., expected uint16 of shape .2,."):
        cloud_message(replace(SWEEP, ring=SWEEP.ring[:1]))

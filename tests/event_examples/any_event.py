"""Any event of each class, for property tests, and when two events are the same."""

import math
from dataclasses import fields

import hypothesis.strategies as st
import numpy as np
from hypothesis.extra.numpy import arrays
from hypothesis.strategies import SearchStrategy

from trigpoint.events.codec import Event
from trigpoint.events.corrected import AnchorLabelled, AnchorRetracted, DriveExcluded, DriveIncluded
from trigpoint.events.estimated import FixJudged, GateAlarmed, PoseFiltered
from trigpoint.events.mapped import (
    AnchorAssociated,
    ImageOffsetSolved,
    LabelGainSolved,
    LandmarkSolved,
    MapSolved,
    OdometryCorrected,
    TrajectorySolved,
)
from trigpoint.events.observed import (
    EventRefused,
    GnssFixReceived,
    ImuMeasured,
    LandmarkDetection,
    LandmarksDetected,
    MapFramePinned,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint.events.perceived import (
    LandmarksPerceived,
    LoopClosed,
    LoopsSought,
    OdometryMatched,
    PerceivedLandmark,
    RefusedLoops,
    SoughtDrive,
)
from trigpoint.events.scanned import PointsScanned

any_float = st.floats()
any_text = st.text(max_size=20)
any_int = st.integers(-(2**63), 2**63 - 1)
# A fix's sigma travels squared: what neither overflows nor underflows then, its sign, 0, infinity and NaN come back.
any_sigma_m = (
    st.floats(1e-150, 1e150) | st.floats(-1e150, -1e-150) | st.sampled_from([0.0, -0.0, math.inf, -math.inf, math.nan])
)
by_kind: dict[type, SearchStrategy[object]] = {float: any_float, str: any_text, int: any_int, bool: st.booleans()}
FLAT = (
    VehicleDescribed,
    WheelSpeedMeasured,
    WheelPairMeasured,
    ImuMeasured,
    MapFramePinned,
    AnchorLabelled,
    AnchorRetracted,
    DriveExcluded,
    DriveIncluded,
    FixJudged,
    GateAlarmed,
)


def _array(*shape: int) -> SearchStrategy[object]:
    return arrays(np.float64, shape, elements=any_float)


def _flat(event_class: type) -> SearchStrategy[object]:
    by_name = {field.name: by_kind[field.type] for field in fields(event_class)}  # type: ignore[index]
    return st.builds(event_class, **by_name)


def _trajectory(count: int) -> SearchStrategy[object]:
    return st.builds(
        TrajectorySolved,
        map_version=any_int,
        vehicle=any_text,
        boot_id=any_text,
        stamp_ns=arrays(np.int64, count),
        pose=_array(count, 3),
        covariance=_array(count, 3, 3),
        calibration=st.lists(st.tuples(any_text, any_float, any_float), max_size=3).map(tuple),
    )


def _sweep(count: int) -> SearchStrategy[object]:
    return st.builds(
        PointsScanned,
        sensor=any_text,
        sensor_position_m=_array(3),
        sensor_orientation=_array(4),
        point_m=arrays(np.float32, (count, 3), elements=st.floats(width=32)),
        intensity=arrays(np.float32, count, elements=st.floats(width=32)),
        offset_ns=arrays(np.int32, count),
        ring=arrays(np.uint16, count),
    )


_detection = st.builds(
    LandmarkDetection,
    range_m=any_float,
    bearing_rad=any_float,
    kind=any_text,
    signature=any_text,
    diameter_m=any_float,
)
_texts = st.lists(any_text, max_size=3).map(tuple)
ANY_EVENT: dict[type, SearchStrategy[object]] = {
    **{event_class: _flat(event_class) for event_class in FLAT},
    GnssFixReceived: st.builds(
        GnssFixReceived, lat_deg=any_float, lon_deg=any_float, height_m=any_float, sigma_m=any_sigma_m
    ),
    LandmarksDetected: st.builds(LandmarksDetected, detections=st.lists(_detection, max_size=4).map(tuple)),
    PointsScanned: st.integers(0, 4).flatmap(_sweep),
    EventRefused: st.builds(
        EventRefused,
        source=any_text,
        reason=any_text,
        detail=any_text,
        schema_name=any_text,
        payload=st.binary(max_size=40),
    ),
    PoseFiltered: st.builds(
        PoseFiltered,
        vehicle=any_text,
        boot_id=any_text,
        x_m=any_float,
        y_m=any_float,
        heading_rad=any_float,
        speed_mps=any_float,
        covariance=_array(3, 3),
    ),
    LandmarksPerceived: st.builds(
        LandmarksPerceived,
        vehicle=any_text,
        boot_id=any_text,
        sensor=any_text,
        sweep_sequence=any_int,
        refusal=any_text,
        landmarks=st.lists(_flat(PerceivedLandmark), max_size=3).map(tuple),
    ),
    OdometryMatched: st.builds(
        OdometryMatched,
        vehicle=any_text,
        boot_id=any_text,
        sensor=any_text,
        from_sequence=any_int,
        from_stamp_ns=any_int,
        sweep_sequence=any_int,
        x_m=any_float,
        y_m=any_float,
        heading_rad=any_float,
        covariance=_array(3, 3),
        matched_share=any_float,
    ),
    LoopClosed: st.builds(
        LoopClosed,
        vehicle=any_text,
        boot_id=any_text,
        sensor=any_text,
        sweep_sequence=any_int,
        other_vehicle=any_text,
        other_boot_id=any_text,
        other_sensor=any_text,
        other_sequence=any_int,
        other_stamp_ns=any_int,
        x_m=any_float,
        y_m=any_float,
        heading_rad=any_float,
        covariance=_array(3, 3),
        matched_share=any_float,
        pairs=any_int,
    ),
    LoopsSought: st.builds(
        LoopsSought,
        vehicle=any_text,
        boot_id=any_text,
        among=st.lists(_flat(SoughtDrive), max_size=3).map(tuple),
        proposed=any_int,
        verified=any_int,
        refused=st.lists(_flat(RefusedLoops), max_size=3).map(tuple),
    ),
    MapSolved: st.builds(
        MapSolved,
        map_version=any_int,
        method=any_text,
        settings_json=any_text,
        inputs=st.lists(st.tuples(any_text, any_int), max_size=3).map(tuple),
        landmark_count=any_int,
        anchor_count=any_int,
        wall_s=any_float,
        base_version=any_int,
        removed=_texts,
    ),
    TrajectorySolved: st.integers(0, 3).flatmap(_trajectory),
    LandmarkSolved: st.builds(
        LandmarkSolved,
        map_version=any_int,
        landmark=any_text,
        kind=any_text,
        signature=any_text,
        position_m=_array(2),
        covariance_m2=_array(2, 2),
        observation_count=any_int,
        vehicles=_texts,
        first_seen_ns=any_int,
        last_seen_ns=any_int,
        anchors=_texts,
        observations=st.lists(st.tuples(any_text, any_text, any_int), max_size=3).map(tuple),
    ),
    AnchorAssociated: st.builds(
        AnchorAssociated,
        map_version=any_int,
        anchor=any_text,
        landmark=any_text,
        reason=any_text,
        residual_m=_array(2),
        image=any_text,
    ),
    ImageOffsetSolved: st.builds(
        ImageOffsetSolved, map_version=any_int, image=any_text, offset_m=_array(2), covariance_m2=_array(2, 2)
    ),
    LabelGainSolved: st.integers(0, 3).flatmap(
        lambda count: st.builds(
            LabelGainSolved,
            map_version=any_int,
            image=any_text,
            landmarks=st.lists(any_text, min_size=count, max_size=count).map(tuple),
            expected_m2=_array(count, 3),
            shared_m4=_array(count, 3),
        )
    ),
    OdometryCorrected: st.builds(
        OdometryCorrected,
        vehicle=any_text,
        boot_id=any_text,
        map_version=any_int,
        T_map_odom=_array(3),
        covariance=_array(3, 3),
    ),
}


def same_value(left: object, right: object) -> bool:
    """Equal of the same type, floats bit by bit but for the kind of NaN, arrays by shape, type and number."""
    if type(left) is not type(right):
        return False
    if isinstance(left, float) and isinstance(right, float):
        both_nan = math.isnan(left) and math.isnan(right)
        return both_nan or (left == right and math.copysign(1.0, left) == math.copysign(1.0, right))
    if isinstance(left, np.ndarray) and isinstance(right, np.ndarray):
        same_kind = left.dtype == right.dtype and left.shape == right.shape
        return same_kind and bool(np.array_equal(left, right, equal_nan=left.dtype.kind == "f"))
    if isinstance(left, tuple) and isinstance(right, tuple):
        return len(left) == len(right) and all(map(same_value, left, right))
    if isinstance(left, LandmarkDetection | PerceivedLandmark):
        return same_fields(left, right)
    return left == right


def same_fields(left: object, right: object) -> bool:
    """All fields of two events of one class have the same values."""
    names = [field.name for field in fields(left)]  # type: ignore[arg-type]
    return type(left) is type(right) and all(same_value(getattr(left, name), getattr(right, name)) for name in names)


def same_event(left: Event, right: Event) -> bool:
    """The events have the same class and the same values."""
    return same_fields(left, right)

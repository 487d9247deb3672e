from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class StreamCount(_message.Message):
    __slots__ = ("stream", "count")
    STREAM_FIELD_NUMBER: _ClassVar[int]
    COUNT_FIELD_NUMBER: _ClassVar[int]
    stream: str
    count: int
    def __init__(self, stream: _Optional[str] = ..., count: _Optional[int] = ...) -> None: ...

class MapSolved(_message.Message):
    __slots__ = ("map_version", "method", "settings_json", "inputs", "landmark_count", "anchor_count", "wall_s", "base_version", "removed")
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    METHOD_FIELD_NUMBER: _ClassVar[int]
    SETTINGS_JSON_FIELD_NUMBER: _ClassVar[int]
    INPUTS_FIELD_NUMBER: _ClassVar[int]
    LANDMARK_COUNT_FIELD_NUMBER: _ClassVar[int]
    ANCHOR_COUNT_FIELD_NUMBER: _ClassVar[int]
    WALL_S_FIELD_NUMBER: _ClassVar[int]
    BASE_VERSION_FIELD_NUMBER: _ClassVar[int]
    REMOVED_FIELD_NUMBER: _ClassVar[int]
    map_version: int
    method: str
    settings_json: str
    inputs: _containers.RepeatedCompositeFieldContainer[StreamCount]
    landmark_count: int
    anchor_count: int
    wall_s: float
    base_version: int
    removed: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, map_version: _Optional[int] = ..., method: _Optional[str] = ..., settings_json: _Optional[str] = ..., inputs: _Optional[_Iterable[_Union[StreamCount, _Mapping[str, object]]]] = ..., landmark_count: _Optional[int] = ..., anchor_count: _Optional[int] = ..., wall_s: _Optional[float] = ..., base_version: _Optional[int] = ..., removed: _Optional[_Iterable[str]] = ...) -> None: ...

class OdometryCorrected(_message.Message):
    __slots__ = ("vehicle", "boot_id", "map_version", "T_map_odom", "covariance")
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    T_MAP_ODOM_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    vehicle: str
    boot_id: str
    map_version: int
    T_map_odom: _containers.RepeatedScalarFieldContainer[float]
    covariance: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, vehicle: _Optional[str] = ..., boot_id: _Optional[str] = ..., map_version: _Optional[int] = ..., T_map_odom: _Optional[_Iterable[float]] = ..., covariance: _Optional[_Iterable[float]] = ...) -> None: ...

class CalibrationState(_message.Message):
    __slots__ = ("name", "value", "sigma")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    SIGMA_FIELD_NUMBER: _ClassVar[int]
    name: str
    value: float
    sigma: float
    def __init__(self, name: _Optional[str] = ..., value: _Optional[float] = ..., sigma: _Optional[float] = ...) -> None: ...

class TrajectorySolved(_message.Message):
    __slots__ = ("map_version", "vehicle", "boot_id", "stamp_ns", "pose", "covariance", "calibration")
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    STAMP_NS_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    CALIBRATION_FIELD_NUMBER: _ClassVar[int]
    map_version: int
    vehicle: str
    boot_id: str
    stamp_ns: _containers.RepeatedScalarFieldContainer[int]
    pose: _containers.RepeatedScalarFieldContainer[float]
    covariance: _containers.RepeatedScalarFieldContainer[float]
    calibration: _containers.RepeatedCompositeFieldContainer[CalibrationState]
    def __init__(self, map_version: _Optional[int] = ..., vehicle: _Optional[str] = ..., boot_id: _Optional[str] = ..., stamp_ns: _Optional[_Iterable[int]] = ..., pose: _Optional[_Iterable[float]] = ..., covariance: _Optional[_Iterable[float]] = ..., calibration: _Optional[_Iterable[_Union[CalibrationState, _Mapping[str, object]]]] = ...) -> None: ...

class SweepReference(_message.Message):
    __slots__ = ("vehicle", "boot_id", "sequence")
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    vehicle: str
    boot_id: str
    sequence: int
    def __init__(self, vehicle: _Optional[str] = ..., boot_id: _Optional[str] = ..., sequence: _Optional[int] = ...) -> None: ...

class LandmarkSolved(_message.Message):
    __slots__ = ("map_version", "landmark", "kind", "signature", "position_m", "covariance_m2", "observation_count", "vehicles", "first_seen_ns", "last_seen_ns", "anchors", "observations")
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    LANDMARK_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    SIGNATURE_FIELD_NUMBER: _ClassVar[int]
    POSITION_M_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_M2_FIELD_NUMBER: _ClassVar[int]
    OBSERVATION_COUNT_FIELD_NUMBER: _ClassVar[int]
    VEHICLES_FIELD_NUMBER: _ClassVar[int]
    FIRST_SEEN_NS_FIELD_NUMBER: _ClassVar[int]
    LAST_SEEN_NS_FIELD_NUMBER: _ClassVar[int]
    ANCHORS_FIELD_NUMBER: _ClassVar[int]
    OBSERVATIONS_FIELD_NUMBER: _ClassVar[int]
    map_version: int
    landmark: str
    kind: str
    signature: str
    position_m: _containers.RepeatedScalarFieldContainer[float]
    covariance_m2: _containers.RepeatedScalarFieldContainer[float]
    observation_count: int
    vehicles: _containers.RepeatedScalarFieldContainer[str]
    first_seen_ns: int
    last_seen_ns: int
    anchors: _containers.RepeatedScalarFieldContainer[str]
    observations: _containers.RepeatedCompositeFieldContainer[SweepReference]
    def __init__(self, map_version: _Optional[int] = ..., landmark: _Optional[str] = ..., kind: _Optional[str] = ..., signature: _Optional[str] = ..., position_m: _Optional[_Iterable[float]] = ..., covariance_m2: _Optional[_Iterable[float]] = ..., observation_count: _Optional[int] = ..., vehicles: _Optional[_Iterable[str]] = ..., first_seen_ns: _Optional[int] = ..., last_seen_ns: _Optional[int] = ..., anchors: _Optional[_Iterable[str]] = ..., observations: _Optional[_Iterable[_Union[SweepReference, _Mapping[str, object]]]] = ...) -> None: ...

class AnchorAssociated(_message.Message):
    __slots__ = ("map_version", "anchor", "landmark", "reason", "residual_m", "image")
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    ANCHOR_FIELD_NUMBER: _ClassVar[int]
    LANDMARK_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_M_FIELD_NUMBER: _ClassVar[int]
    IMAGE_FIELD_NUMBER: _ClassVar[int]
    map_version: int
    anchor: str
    landmark: str
    reason: str
    residual_m: _containers.RepeatedScalarFieldContainer[float]
    image: str
    def __init__(self, map_version: _Optional[int] = ..., anchor: _Optional[str] = ..., landmark: _Optional[str] = ..., reason: _Optional[str] = ..., residual_m: _Optional[_Iterable[float]] = ..., image: _Optional[str] = ...) -> None: ...

class ImageOffsetSolved(_message.Message):
    __slots__ = ("map_version", "image", "offset_m", "covariance_m2")
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    IMAGE_FIELD_NUMBER: _ClassVar[int]
    OFFSET_M_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_M2_FIELD_NUMBER: _ClassVar[int]
    map_version: int
    image: str
    offset_m: _containers.RepeatedScalarFieldContainer[float]
    covariance_m2: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, map_version: _Optional[int] = ..., image: _Optional[str] = ..., offset_m: _Optional[_Iterable[float]] = ..., covariance_m2: _Optional[_Iterable[float]] = ...) -> None: ...

class LabelGainSolved(_message.Message):
    __slots__ = ("map_version", "image", "landmarks", "expected_m2", "shared_m4")
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    IMAGE_FIELD_NUMBER: _ClassVar[int]
    LANDMARKS_FIELD_NUMBER: _ClassVar[int]
    EXPECTED_M2_FIELD_NUMBER: _ClassVar[int]
    SHARED_M4_FIELD_NUMBER: _ClassVar[int]
    map_version: int
    image: str
    landmarks: _containers.RepeatedScalarFieldContainer[str]
    expected_m2: _containers.RepeatedScalarFieldContainer[float]
    shared_m4: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, map_version: _Optional[int] = ..., image: _Optional[str] = ..., landmarks: _Optional[_Iterable[str]] = ..., expected_m2: _Optional[_Iterable[float]] = ..., shared_m4: _Optional[_Iterable[float]] = ...) -> None: ...

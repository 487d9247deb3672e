from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class PerceivedLandmark(_message.Message):
    __slots__ = ("kind", "landmark_class", "track", "x_m", "y_m", "variance_x_m2", "covariance_xy_m2", "variance_y_m2", "height_m", "diameter_m", "points")
    KIND_FIELD_NUMBER: _ClassVar[int]
    LANDMARK_CLASS_FIELD_NUMBER: _ClassVar[int]
    TRACK_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    VARIANCE_X_M2_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_XY_M2_FIELD_NUMBER: _ClassVar[int]
    VARIANCE_Y_M2_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
    DIAMETER_M_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    kind: str
    landmark_class: str
    track: int
    x_m: float
    y_m: float
    variance_x_m2: float
    covariance_xy_m2: float
    variance_y_m2: float
    height_m: float
    diameter_m: float
    points: int
    def __init__(self, kind: _Optional[str] = ..., landmark_class: _Optional[str] = ..., track: _Optional[int] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., variance_x_m2: _Optional[float] = ..., covariance_xy_m2: _Optional[float] = ..., variance_y_m2: _Optional[float] = ..., height_m: _Optional[float] = ..., diameter_m: _Optional[float] = ..., points: _Optional[int] = ...) -> None: ...

class LandmarksPerceived(_message.Message):
    __slots__ = ("vehicle", "boot_id", "sensor", "sweep_sequence", "refusal", "landmarks")
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    SENSOR_FIELD_NUMBER: _ClassVar[int]
    SWEEP_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    REFUSAL_FIELD_NUMBER: _ClassVar[int]
    LANDMARKS_FIELD_NUMBER: _ClassVar[int]
    vehicle: str
    boot_id: str
    sensor: str
    sweep_sequence: int
    refusal: str
    landmarks: _containers.RepeatedCompositeFieldContainer[PerceivedLandmark]
    def __init__(self, vehicle: _Optional[str] = ..., boot_id: _Optional[str] = ..., sensor: _Optional[str] = ..., sweep_sequence: _Optional[int] = ..., refusal: _Optional[str] = ..., landmarks: _Optional[_Iterable[_Union[PerceivedLandmark, _Mapping[str, object]]]] = ...) -> None: ...

class OdometryMatched(_message.Message):
    __slots__ = ("vehicle", "boot_id", "sensor", "from_sequence", "from_stamp_ns", "sweep_sequence", "x_m", "y_m", "heading_rad", "covariance", "matched_share")
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    SENSOR_FIELD_NUMBER: _ClassVar[int]
    FROM_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    FROM_STAMP_NS_FIELD_NUMBER: _ClassVar[int]
    SWEEP_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    HEADING_RAD_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    MATCHED_SHARE_FIELD_NUMBER: _ClassVar[int]
    vehicle: str
    boot_id: str
    sensor: str
    from_sequence: int
    from_stamp_ns: int
    sweep_sequence: int
    x_m: float
    y_m: float
    heading_rad: float
    covariance: _containers.RepeatedScalarFieldContainer[float]
    matched_share: float
    def __init__(self, vehicle: _Optional[str] = ..., boot_id: _Optional[str] = ..., sensor: _Optional[str] = ..., from_sequence: _Optional[int] = ..., from_stamp_ns: _Optional[int] = ..., sweep_sequence: _Optional[int] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., heading_rad: _Optional[float] = ..., covariance: _Optional[_Iterable[float]] = ..., matched_share: _Optional[float] = ...) -> None: ...

class LoopClosed(_message.Message):
    __slots__ = ("vehicle", "boot_id", "sensor", "sweep_sequence", "other_vehicle", "other_boot_id", "other_sensor", "other_sequence", "other_stamp_ns", "x_m", "y_m", "heading_rad", "covariance", "matched_share", "pairs")
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    SENSOR_FIELD_NUMBER: _ClassVar[int]
    SWEEP_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    OTHER_VEHICLE_FIELD_NUMBER: _ClassVar[int]
    OTHER_BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    OTHER_SENSOR_FIELD_NUMBER: _ClassVar[int]
    OTHER_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    OTHER_STAMP_NS_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    HEADING_RAD_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    MATCHED_SHARE_FIELD_NUMBER: _ClassVar[int]
    PAIRS_FIELD_NUMBER: _ClassVar[int]
    vehicle: str
    boot_id: str
    sensor: str
    sweep_sequence: int
    other_vehicle: str
    other_boot_id: str
    other_sensor: str
    other_sequence: int
    other_stamp_ns: int
    x_m: float
    y_m: float
    heading_rad: float
    covariance: _containers.RepeatedScalarFieldContainer[float]
    matched_share: float
    pairs: int
    def __init__(self, vehicle: _Optional[str] = ..., boot_id: _Optional[str] = ..., sensor: _Optional[str] = ..., sweep_sequence: _Optional[int] = ..., other_vehicle: _Optional[str] = ..., other_boot_id: _Optional[str] = ..., other_sensor: _Optional[str] = ..., other_sequence: _Optional[int] = ..., other_stamp_ns: _Optional[int] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., heading_rad: _Optional[float] = ..., covariance: _Optional[_Iterable[float]] = ..., matched_share: _Optional[float] = ..., pairs: _Optional[int] = ...) -> None: ...

class SoughtDrive(_message.Message):
    __slots__ = ("vehicle", "boot_id")
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    vehicle: str
    boot_id: str
    def __init__(self, vehicle: _Optional[str] = ..., boot_id: _Optional[str] = ...) -> None: ...

class RefusedLoops(_message.Message):
    __slots__ = ("reason", "count")
    REASON_FIELD_NUMBER: _ClassVar[int]
    COUNT_FIELD_NUMBER: _ClassVar[int]
    reason: str
    count: int
    def __init__(self, reason: _Optional[str] = ..., count: _Optional[int] = ...) -> None: ...

class LoopsSought(_message.Message):
    __slots__ = ("vehicle", "boot_id", "among", "proposed", "verified", "refused")
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    AMONG_FIELD_NUMBER: _ClassVar[int]
    PROPOSED_FIELD_NUMBER: _ClassVar[int]
    VERIFIED_FIELD_NUMBER: _ClassVar[int]
    REFUSED_FIELD_NUMBER: _ClassVar[int]
    vehicle: str
    boot_id: str
    among: _containers.RepeatedCompositeFieldContainer[SoughtDrive]
    proposed: int
    verified: int
    refused: _containers.RepeatedCompositeFieldContainer[RefusedLoops]
    def __init__(self, vehicle: _Optional[str] = ..., boot_id: _Optional[str] = ..., among: _Optional[_Iterable[_Union[SoughtDrive, _Mapping[str, object]]]] = ..., proposed: _Optional[int] = ..., verified: _Optional[int] = ..., refused: _Optional[_Iterable[_Union[RefusedLoops, _Mapping[str, object]]]] = ...) -> None: ...

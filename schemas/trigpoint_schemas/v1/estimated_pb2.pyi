from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable
from typing import ClassVar as _ClassVar, Optional as _Optional

DESCRIPTOR: _descriptor.FileDescriptor

class FixJudged(_message.Message):
    __slots__ = ("vehicle", "boot_id", "fix_sequence", "accepted", "reason", "nis", "limit", "innovation_x_m", "innovation_y_m")
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    FIX_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    ACCEPTED_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    NIS_FIELD_NUMBER: _ClassVar[int]
    LIMIT_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_X_M_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_Y_M_FIELD_NUMBER: _ClassVar[int]
    vehicle: str
    boot_id: str
    fix_sequence: int
    accepted: bool
    reason: str
    nis: float
    limit: float
    innovation_x_m: float
    innovation_y_m: float
    def __init__(self, vehicle: _Optional[str] = ..., boot_id: _Optional[str] = ..., fix_sequence: _Optional[int] = ..., accepted: _Optional[bool] = ..., reason: _Optional[str] = ..., nis: _Optional[float] = ..., limit: _Optional[float] = ..., innovation_x_m: _Optional[float] = ..., innovation_y_m: _Optional[float] = ...) -> None: ...

class PoseFiltered(_message.Message):
    __slots__ = ("vehicle", "boot_id", "x_m", "y_m", "heading_rad", "speed_mps", "covariance")
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    HEADING_RAD_FIELD_NUMBER: _ClassVar[int]
    SPEED_MPS_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    vehicle: str
    boot_id: str
    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    covariance: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, vehicle: _Optional[str] = ..., boot_id: _Optional[str] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., heading_rad: _Optional[float] = ..., speed_mps: _Optional[float] = ..., covariance: _Optional[_Iterable[float]] = ...) -> None: ...

class GateAlarmed(_message.Message):
    __slots__ = ("vehicle", "boot_id", "reason", "duration_s")
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    DURATION_S_FIELD_NUMBER: _ClassVar[int]
    vehicle: str
    boot_id: str
    reason: str
    duration_s: float
    def __init__(self, vehicle: _Optional[str] = ..., boot_id: _Optional[str] = ..., reason: _Optional[str] = ..., duration_s: _Optional[float] = ...) -> None: ...

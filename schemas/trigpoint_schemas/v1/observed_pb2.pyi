from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class VehicleDescribed(_message.Message):
    __slots__ = ("vehicle", "wheelbase_m", "track_m", "speed_wheel_y_m", "antenna_x_m", "antenna_y_m", "landmark_sensor_x_m", "landmark_sensor_y_m", "landmark_sensor_yaw_rad", "landmark_sensor_range_m", "declared_crs", "declared_origin_easting_m", "declared_origin_northing_m", "software", "landmark_sensor_model")
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    WHEELBASE_M_FIELD_NUMBER: _ClassVar[int]
    TRACK_M_FIELD_NUMBER: _ClassVar[int]
    SPEED_WHEEL_Y_M_FIELD_NUMBER: _ClassVar[int]
    ANTENNA_X_M_FIELD_NUMBER: _ClassVar[int]
    ANTENNA_Y_M_FIELD_NUMBER: _ClassVar[int]
    LANDMARK_SENSOR_X_M_FIELD_NUMBER: _ClassVar[int]
    LANDMARK_SENSOR_Y_M_FIELD_NUMBER: _ClassVar[int]
    LANDMARK_SENSOR_YAW_RAD_FIELD_NUMBER: _ClassVar[int]
    LANDMARK_SENSOR_RANGE_M_FIELD_NUMBER: _ClassVar[int]
    DECLARED_CRS_FIELD_NUMBER: _ClassVar[int]
    DECLARED_ORIGIN_EASTING_M_FIELD_NUMBER: _ClassVar[int]
    DECLARED_ORIGIN_NORTHING_M_FIELD_NUMBER: _ClassVar[int]
    SOFTWARE_FIELD_NUMBER: _ClassVar[int]
    LANDMARK_SENSOR_MODEL_FIELD_NUMBER: _ClassVar[int]
    vehicle: str
    wheelbase_m: float
    track_m: float
    speed_wheel_y_m: float
    antenna_x_m: float
    antenna_y_m: float
    landmark_sensor_x_m: float
    landmark_sensor_y_m: float
    landmark_sensor_yaw_rad: float
    landmark_sensor_range_m: float
    declared_crs: str
    declared_origin_easting_m: float
    declared_origin_northing_m: float
    software: str
    landmark_sensor_model: str
    def __init__(self, vehicle: _Optional[str] = ..., wheelbase_m: _Optional[float] = ..., track_m: _Optional[float] = ..., speed_wheel_y_m: _Optional[float] = ..., antenna_x_m: _Optional[float] = ..., antenna_y_m: _Optional[float] = ..., landmark_sensor_x_m: _Optional[float] = ..., landmark_sensor_y_m: _Optional[float] = ..., landmark_sensor_yaw_rad: _Optional[float] = ..., landmark_sensor_range_m: _Optional[float] = ..., declared_crs: _Optional[str] = ..., declared_origin_easting_m: _Optional[float] = ..., declared_origin_northing_m: _Optional[float] = ..., software: _Optional[str] = ..., landmark_sensor_model: _Optional[str] = ...) -> None: ...

class WheelSpeedMeasured(_message.Message):
    __slots__ = ("speed_mps", "steering_rad", "yaw_rate_radps")
    SPEED_MPS_FIELD_NUMBER: _ClassVar[int]
    STEERING_RAD_FIELD_NUMBER: _ClassVar[int]
    YAW_RATE_RADPS_FIELD_NUMBER: _ClassVar[int]
    speed_mps: float
    steering_rad: float
    yaw_rate_radps: float
    def __init__(self, speed_mps: _Optional[float] = ..., steering_rad: _Optional[float] = ..., yaw_rate_radps: _Optional[float] = ...) -> None: ...

class WheelPairMeasured(_message.Message):
    __slots__ = ("left_mps", "right_mps")
    LEFT_MPS_FIELD_NUMBER: _ClassVar[int]
    RIGHT_MPS_FIELD_NUMBER: _ClassVar[int]
    left_mps: float
    right_mps: float
    def __init__(self, left_mps: _Optional[float] = ..., right_mps: _Optional[float] = ...) -> None: ...

class ImuMeasured(_message.Message):
    __slots__ = ("yaw_rate_radps", "acceleration_x_mps2", "acceleration_y_mps2")
    YAW_RATE_RADPS_FIELD_NUMBER: _ClassVar[int]
    ACCELERATION_X_MPS2_FIELD_NUMBER: _ClassVar[int]
    ACCELERATION_Y_MPS2_FIELD_NUMBER: _ClassVar[int]
    yaw_rate_radps: float
    acceleration_x_mps2: float
    acceleration_y_mps2: float
    def __init__(self, yaw_rate_radps: _Optional[float] = ..., acceleration_x_mps2: _Optional[float] = ..., acceleration_y_mps2: _Optional[float] = ...) -> None: ...

class LandmarkDetection(_message.Message):
    __slots__ = ("range_m", "bearing_rad", "kind", "signature", "diameter_m")
    RANGE_M_FIELD_NUMBER: _ClassVar[int]
    BEARING_RAD_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    SIGNATURE_FIELD_NUMBER: _ClassVar[int]
    DIAMETER_M_FIELD_NUMBER: _ClassVar[int]
    range_m: float
    bearing_rad: float
    kind: str
    signature: str
    diameter_m: float
    def __init__(self, range_m: _Optional[float] = ..., bearing_rad: _Optional[float] = ..., kind: _Optional[str] = ..., signature: _Optional[str] = ..., diameter_m: _Optional[float] = ...) -> None: ...

class LandmarksDetected(_message.Message):
    __slots__ = ("detections",)
    DETECTIONS_FIELD_NUMBER: _ClassVar[int]
    detections: _containers.RepeatedCompositeFieldContainer[LandmarkDetection]
    def __init__(self, detections: _Optional[_Iterable[_Union[LandmarkDetection, _Mapping[str, object]]]] = ...) -> None: ...

class EventRefused(_message.Message):
    __slots__ = ("source", "reason", "detail", "schema_name", "payload")
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    SCHEMA_NAME_FIELD_NUMBER: _ClassVar[int]
    PAYLOAD_FIELD_NUMBER: _ClassVar[int]
    source: str
    reason: str
    detail: str
    schema_name: str
    payload: bytes
    def __init__(self, source: _Optional[str] = ..., reason: _Optional[str] = ..., detail: _Optional[str] = ..., schema_name: _Optional[str] = ..., payload: _Optional[bytes] = ...) -> None: ...

class MapFramePinned(_message.Message):
    __slots__ = ("crs", "origin_easting_m", "origin_northing_m", "declared_by")
    CRS_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_EASTING_M_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_NORTHING_M_FIELD_NUMBER: _ClassVar[int]
    DECLARED_BY_FIELD_NUMBER: _ClassVar[int]
    crs: str
    origin_easting_m: float
    origin_northing_m: float
    declared_by: str
    def __init__(self, crs: _Optional[str] = ..., origin_easting_m: _Optional[float] = ..., origin_northing_m: _Optional[float] = ..., declared_by: _Optional[str] = ...) -> None: ...

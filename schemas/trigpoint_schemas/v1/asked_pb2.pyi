from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class AnswerForm(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ANSWER_FORM_PROTOBUF: _ClassVar[AnswerForm]
    ANSWER_FORM_GEOJSON: _ClassVar[AnswerForm]
ANSWER_FORM_PROTOBUF: AnswerForm
ANSWER_FORM_GEOJSON: AnswerForm

class AskedBox(_message.Message):
    __slots__ = ("lon_min_deg", "lat_min_deg", "lon_max_deg", "lat_max_deg")
    LON_MIN_DEG_FIELD_NUMBER: _ClassVar[int]
    LAT_MIN_DEG_FIELD_NUMBER: _ClassVar[int]
    LON_MAX_DEG_FIELD_NUMBER: _ClassVar[int]
    LAT_MAX_DEG_FIELD_NUMBER: _ClassVar[int]
    lon_min_deg: float
    lat_min_deg: float
    lon_max_deg: float
    lat_max_deg: float
    def __init__(self, lon_min_deg: _Optional[float] = ..., lat_min_deg: _Optional[float] = ..., lon_max_deg: _Optional[float] = ..., lat_max_deg: _Optional[float] = ...) -> None: ...

class AskedDisc(_message.Message):
    __slots__ = ("lat_deg", "lon_deg", "radius_m")
    LAT_DEG_FIELD_NUMBER: _ClassVar[int]
    LON_DEG_FIELD_NUMBER: _ClassVar[int]
    RADIUS_M_FIELD_NUMBER: _ClassVar[int]
    lat_deg: float
    lon_deg: float
    radius_m: float
    def __init__(self, lat_deg: _Optional[float] = ..., lon_deg: _Optional[float] = ..., radius_m: _Optional[float] = ...) -> None: ...

class AskedNearest(_message.Message):
    __slots__ = ("lat_deg", "lon_deg", "count")
    LAT_DEG_FIELD_NUMBER: _ClassVar[int]
    LON_DEG_FIELD_NUMBER: _ClassVar[int]
    COUNT_FIELD_NUMBER: _ClassVar[int]
    lat_deg: float
    lon_deg: float
    count: int
    def __init__(self, lat_deg: _Optional[float] = ..., lon_deg: _Optional[float] = ..., count: _Optional[int] = ...) -> None: ...

class AskedSpan(_message.Message):
    __slots__ = ("first_ns", "last_ns")
    FIRST_NS_FIELD_NUMBER: _ClassVar[int]
    LAST_NS_FIELD_NUMBER: _ClassVar[int]
    first_ns: int
    last_ns: int
    def __init__(self, first_ns: _Optional[int] = ..., last_ns: _Optional[int] = ...) -> None: ...

class LandmarksAsked(_message.Message):
    __slots__ = ("bbox", "near", "nearest", "kinds", "max_sigma_m", "vehicle", "seen", "as_of", "limit", "page", "crs", "form")
    BBOX_FIELD_NUMBER: _ClassVar[int]
    NEAR_FIELD_NUMBER: _ClassVar[int]
    NEAREST_FIELD_NUMBER: _ClassVar[int]
    KINDS_FIELD_NUMBER: _ClassVar[int]
    MAX_SIGMA_M_FIELD_NUMBER: _ClassVar[int]
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    SEEN_FIELD_NUMBER: _ClassVar[int]
    AS_OF_FIELD_NUMBER: _ClassVar[int]
    LIMIT_FIELD_NUMBER: _ClassVar[int]
    PAGE_FIELD_NUMBER: _ClassVar[int]
    CRS_FIELD_NUMBER: _ClassVar[int]
    FORM_FIELD_NUMBER: _ClassVar[int]
    bbox: AskedBox
    near: AskedDisc
    nearest: AskedNearest
    kinds: _containers.RepeatedScalarFieldContainer[str]
    max_sigma_m: float
    vehicle: str
    seen: AskedSpan
    as_of: int
    limit: int
    page: str
    crs: str
    form: AnswerForm
    def __init__(self, bbox: _Optional[_Union[AskedBox, _Mapping[str, object]]] = ..., near: _Optional[_Union[AskedDisc, _Mapping[str, object]]] = ..., nearest: _Optional[_Union[AskedNearest, _Mapping[str, object]]] = ..., kinds: _Optional[_Iterable[str]] = ..., max_sigma_m: _Optional[float] = ..., vehicle: _Optional[str] = ..., seen: _Optional[_Union[AskedSpan, _Mapping[str, object]]] = ..., as_of: _Optional[int] = ..., limit: _Optional[int] = ..., page: _Optional[str] = ..., crs: _Optional[str] = ..., form: _Optional[_Union[AnswerForm, str]] = ...) -> None: ...

class ChangesAsked(_message.Message):
    __slots__ = ("landmarks", "since")
    LANDMARKS_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    landmarks: LandmarksAsked
    since: int
    def __init__(self, landmarks: _Optional[_Union[LandmarksAsked, _Mapping[str, object]]] = ..., since: _Optional[int] = ...) -> None: ...

class CoverageAsked(_message.Message):
    __slots__ = ("bbox", "seen", "vehicle")
    BBOX_FIELD_NUMBER: _ClassVar[int]
    SEEN_FIELD_NUMBER: _ClassVar[int]
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    bbox: AskedBox
    seen: AskedSpan
    vehicle: str
    def __init__(self, bbox: _Optional[_Union[AskedBox, _Mapping[str, object]]] = ..., seen: _Optional[_Union[AskedSpan, _Mapping[str, object]]] = ..., vehicle: _Optional[str] = ...) -> None: ...

class AnsweredMap(_message.Message):
    __slots__ = ("map_version", "solved_ns", "crs", "origin_easting_m", "origin_northing_m")
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    SOLVED_NS_FIELD_NUMBER: _ClassVar[int]
    CRS_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_EASTING_M_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_NORTHING_M_FIELD_NUMBER: _ClassVar[int]
    map_version: int
    solved_ns: int
    crs: str
    origin_easting_m: float
    origin_northing_m: float
    def __init__(self, map_version: _Optional[int] = ..., solved_ns: _Optional[int] = ..., crs: _Optional[str] = ..., origin_easting_m: _Optional[float] = ..., origin_northing_m: _Optional[float] = ...) -> None: ...

class AnsweredLandmark(_message.Message):
    __slots__ = ("landmark", "kind", "signature", "x_m", "y_m", "lat_deg", "lon_deg", "variance_x_m2", "covariance_xy_m2", "variance_y_m2", "sigma_major_m", "sigma_minor_m", "ellipse_heading_rad", "observation_count", "vehicles", "first_seen_ns", "last_seen_ns", "anchored", "anchors", "valid_from_version", "valid_to_version", "out_x", "out_y")
    LANDMARK_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    SIGNATURE_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    LAT_DEG_FIELD_NUMBER: _ClassVar[int]
    LON_DEG_FIELD_NUMBER: _ClassVar[int]
    VARIANCE_X_M2_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_XY_M2_FIELD_NUMBER: _ClassVar[int]
    VARIANCE_Y_M2_FIELD_NUMBER: _ClassVar[int]
    SIGMA_MAJOR_M_FIELD_NUMBER: _ClassVar[int]
    SIGMA_MINOR_M_FIELD_NUMBER: _ClassVar[int]
    ELLIPSE_HEADING_RAD_FIELD_NUMBER: _ClassVar[int]
    OBSERVATION_COUNT_FIELD_NUMBER: _ClassVar[int]
    VEHICLES_FIELD_NUMBER: _ClassVar[int]
    FIRST_SEEN_NS_FIELD_NUMBER: _ClassVar[int]
    LAST_SEEN_NS_FIELD_NUMBER: _ClassVar[int]
    ANCHORED_FIELD_NUMBER: _ClassVar[int]
    ANCHORS_FIELD_NUMBER: _ClassVar[int]
    VALID_FROM_VERSION_FIELD_NUMBER: _ClassVar[int]
    VALID_TO_VERSION_FIELD_NUMBER: _ClassVar[int]
    OUT_X_FIELD_NUMBER: _ClassVar[int]
    OUT_Y_FIELD_NUMBER: _ClassVar[int]
    landmark: str
    kind: str
    signature: str
    x_m: float
    y_m: float
    lat_deg: float
    lon_deg: float
    variance_x_m2: float
    covariance_xy_m2: float
    variance_y_m2: float
    sigma_major_m: float
    sigma_minor_m: float
    ellipse_heading_rad: float
    observation_count: int
    vehicles: _containers.RepeatedScalarFieldContainer[str]
    first_seen_ns: int
    last_seen_ns: int
    anchored: bool
    anchors: _containers.RepeatedScalarFieldContainer[str]
    valid_from_version: int
    valid_to_version: int
    out_x: float
    out_y: float
    def __init__(self, landmark: _Optional[str] = ..., kind: _Optional[str] = ..., signature: _Optional[str] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., lat_deg: _Optional[float] = ..., lon_deg: _Optional[float] = ..., variance_x_m2: _Optional[float] = ..., covariance_xy_m2: _Optional[float] = ..., variance_y_m2: _Optional[float] = ..., sigma_major_m: _Optional[float] = ..., sigma_minor_m: _Optional[float] = ..., ellipse_heading_rad: _Optional[float] = ..., observation_count: _Optional[int] = ..., vehicles: _Optional[_Iterable[str]] = ..., first_seen_ns: _Optional[int] = ..., last_seen_ns: _Optional[int] = ..., anchored: _Optional[bool] = ..., anchors: _Optional[_Iterable[str]] = ..., valid_from_version: _Optional[int] = ..., valid_to_version: _Optional[int] = ..., out_x: _Optional[float] = ..., out_y: _Optional[float] = ...) -> None: ...

class LandmarksAnswered(_message.Message):
    __slots__ = ("map", "crs", "next_page", "landmarks")
    MAP_FIELD_NUMBER: _ClassVar[int]
    CRS_FIELD_NUMBER: _ClassVar[int]
    NEXT_PAGE_FIELD_NUMBER: _ClassVar[int]
    LANDMARKS_FIELD_NUMBER: _ClassVar[int]
    map: AnsweredMap
    crs: str
    next_page: str
    landmarks: _containers.RepeatedCompositeFieldContainer[AnsweredLandmark]
    def __init__(self, map: _Optional[_Union[AnsweredMap, _Mapping[str, object]]] = ..., crs: _Optional[str] = ..., next_page: _Optional[str] = ..., landmarks: _Optional[_Iterable[_Union[AnsweredLandmark, _Mapping[str, object]]]] = ...) -> None: ...

class ChangesAnswered(_message.Message):
    __slots__ = ("map", "crs", "since", "changed", "removed")
    MAP_FIELD_NUMBER: _ClassVar[int]
    CRS_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    CHANGED_FIELD_NUMBER: _ClassVar[int]
    REMOVED_FIELD_NUMBER: _ClassVar[int]
    map: AnsweredMap
    crs: str
    since: int
    changed: _containers.RepeatedCompositeFieldContainer[AnsweredLandmark]
    removed: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, map: _Optional[_Union[AnsweredMap, _Mapping[str, object]]] = ..., crs: _Optional[str] = ..., since: _Optional[int] = ..., changed: _Optional[_Iterable[_Union[AnsweredLandmark, _Mapping[str, object]]]] = ..., removed: _Optional[_Iterable[str]] = ...) -> None: ...

class CoveredTile(_message.Message):
    __slots__ = ("column", "row", "vehicle", "first_ns", "last_ns", "sweep_count")
    COLUMN_FIELD_NUMBER: _ClassVar[int]
    ROW_FIELD_NUMBER: _ClassVar[int]
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    FIRST_NS_FIELD_NUMBER: _ClassVar[int]
    LAST_NS_FIELD_NUMBER: _ClassVar[int]
    SWEEP_COUNT_FIELD_NUMBER: _ClassVar[int]
    column: int
    row: int
    vehicle: str
    first_ns: int
    last_ns: int
    sweep_count: int
    def __init__(self, column: _Optional[int] = ..., row: _Optional[int] = ..., vehicle: _Optional[str] = ..., first_ns: _Optional[int] = ..., last_ns: _Optional[int] = ..., sweep_count: _Optional[int] = ...) -> None: ...

class CoverageAnswered(_message.Message):
    __slots__ = ("map", "zoom", "tiles")
    MAP_FIELD_NUMBER: _ClassVar[int]
    ZOOM_FIELD_NUMBER: _ClassVar[int]
    TILES_FIELD_NUMBER: _ClassVar[int]
    map: AnsweredMap
    zoom: int
    tiles: _containers.RepeatedCompositeFieldContainer[CoveredTile]
    def __init__(self, map: _Optional[_Union[AnsweredMap, _Mapping[str, object]]] = ..., zoom: _Optional[int] = ..., tiles: _Optional[_Iterable[_Union[CoveredTile, _Mapping[str, object]]]] = ...) -> None: ...

class AskRefused(_message.Message):
    __slots__ = ("reason", "detail")
    REASON_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    reason: str
    detail: str
    def __init__(self, reason: _Optional[str] = ..., detail: _Optional[str] = ...) -> None: ...

class TileChanged(_message.Message):
    __slots__ = ("before", "after", "changed", "removed")
    BEFORE_FIELD_NUMBER: _ClassVar[int]
    AFTER_FIELD_NUMBER: _ClassVar[int]
    CHANGED_FIELD_NUMBER: _ClassVar[int]
    REMOVED_FIELD_NUMBER: _ClassVar[int]
    before: int
    after: int
    changed: _containers.RepeatedCompositeFieldContainer[AnsweredLandmark]
    removed: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, before: _Optional[int] = ..., after: _Optional[int] = ..., changed: _Optional[_Iterable[_Union[AnsweredLandmark, _Mapping[str, object]]]] = ..., removed: _Optional[_Iterable[str]] = ...) -> None: ...

class MapChanged(_message.Message):
    __slots__ = ("map", "before", "zoom", "columns", "rows", "all_tiles")
    MAP_FIELD_NUMBER: _ClassVar[int]
    BEFORE_FIELD_NUMBER: _ClassVar[int]
    ZOOM_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    ROWS_FIELD_NUMBER: _ClassVar[int]
    ALL_TILES_FIELD_NUMBER: _ClassVar[int]
    map: AnsweredMap
    before: int
    zoom: int
    columns: _containers.RepeatedScalarFieldContainer[int]
    rows: _containers.RepeatedScalarFieldContainer[int]
    all_tiles: bool
    def __init__(self, map: _Optional[_Union[AnsweredMap, _Mapping[str, object]]] = ..., before: _Optional[int] = ..., zoom: _Optional[int] = ..., columns: _Optional[_Iterable[int]] = ..., rows: _Optional[_Iterable[int]] = ..., all_tiles: _Optional[bool] = ...) -> None: ...

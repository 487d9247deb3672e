from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Optional as _Optional

DESCRIPTOR: _descriptor.FileDescriptor

class AnchorLabelled(_message.Message):
    __slots__ = ("anchor", "lat_deg", "lon_deg", "sigma_m", "image", "image_sigma_m", "kind", "signature", "source_crs", "operation")
    ANCHOR_FIELD_NUMBER: _ClassVar[int]
    LAT_DEG_FIELD_NUMBER: _ClassVar[int]
    LON_DEG_FIELD_NUMBER: _ClassVar[int]
    SIGMA_M_FIELD_NUMBER: _ClassVar[int]
    IMAGE_FIELD_NUMBER: _ClassVar[int]
    IMAGE_SIGMA_M_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    SIGNATURE_FIELD_NUMBER: _ClassVar[int]
    SOURCE_CRS_FIELD_NUMBER: _ClassVar[int]
    OPERATION_FIELD_NUMBER: _ClassVar[int]
    anchor: str
    lat_deg: float
    lon_deg: float
    sigma_m: float
    image: str
    image_sigma_m: float
    kind: str
    signature: str
    source_crs: str
    operation: str
    def __init__(self, anchor: _Optional[str] = ..., lat_deg: _Optional[float] = ..., lon_deg: _Optional[float] = ..., sigma_m: _Optional[float] = ..., image: _Optional[str] = ..., image_sigma_m: _Optional[float] = ..., kind: _Optional[str] = ..., signature: _Optional[str] = ..., source_crs: _Optional[str] = ..., operation: _Optional[str] = ...) -> None: ...

class AnchorRetracted(_message.Message):
    __slots__ = ("anchor", "image", "author", "reason")
    ANCHOR_FIELD_NUMBER: _ClassVar[int]
    IMAGE_FIELD_NUMBER: _ClassVar[int]
    AUTHOR_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    anchor: str
    image: str
    author: str
    reason: str
    def __init__(self, anchor: _Optional[str] = ..., image: _Optional[str] = ..., author: _Optional[str] = ..., reason: _Optional[str] = ...) -> None: ...

class DriveExcluded(_message.Message):
    __slots__ = ("vehicle", "boot_id", "author", "reason")
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    AUTHOR_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    vehicle: str
    boot_id: str
    author: str
    reason: str
    def __init__(self, vehicle: _Optional[str] = ..., boot_id: _Optional[str] = ..., author: _Optional[str] = ..., reason: _Optional[str] = ...) -> None: ...

class DriveIncluded(_message.Message):
    __slots__ = ("vehicle", "boot_id", "author", "reason")
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    AUTHOR_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    vehicle: str
    boot_id: str
    author: str
    reason: str
    def __init__(self, vehicle: _Optional[str] = ..., boot_id: _Optional[str] = ..., author: _Optional[str] = ..., reason: _Optional[str] = ...) -> None: ...

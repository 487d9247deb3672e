"""Where an event goes: its key on the bus and its stream in the log."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from trigpoint.errors import InputError
from trigpoint.events.corrected import AnchorLabelled, AnchorRetracted, DriveExcluded, DriveIncluded
from trigpoint.events.envelope import Envelope
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
    LandmarksDetected,
    MapFramePinned,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint.events.perceived import LandmarksPerceived, LoopClosed, LoopsSought, OdometryMatched
from trigpoint.events.scanned import PointsScanned
from trigpoint.geodesy.positions import MapPosition
from trigpoint.geodesy.web_tiles import tile_at

if TYPE_CHECKING:
    from trigpoint.geodesy.projection import MapFrame

VEHICLE_NAMING = (
    FixJudged,
    PoseFiltered,
    GateAlarmed,
    LandmarksPerceived,
    OdometryMatched,
    LoopClosed,
    LoopsSought,
    TrajectorySolved,
    OdometryCorrected,
)

DEFAULT_ROOT = "trigpoint"
DEFAULT_MAP = "main"
KEY_VERSION = "v1"
LANDMARK_ZOOM = 16  # tiles of some 500 m at 35 degrees of latitude: a few dozen poles each
FORBIDDEN_CHARACTERS = frozenset("*?#$/")  # Zenoh's own characters, in a key expression
NAME_LIMIT = 60  # characters: a stream's folder stays under the 255 bytes of a file name in any script

KEY_PATTERNS: Mapping[type, str] = {
    VehicleDescribed: "veh/{vehicle}/obs/description",
    WheelSpeedMeasured: "veh/{vehicle}/obs/wheel",
    WheelPairMeasured: "veh/{vehicle}/obs/wheel-pair",
    ImuMeasured: "veh/{vehicle}/obs/imu",
    GnssFixReceived: "veh/{vehicle}/obs/gnss",
    LandmarksDetected: "veh/{vehicle}/obs/landmarks",
    PointsScanned: "veh/{vehicle}/obs/points",
    EventRefused: "refused",
    MapFramePinned: "map/{map}/frame",
    AnchorLabelled: "map/{map}/anchor",
    AnchorRetracted: "map/{map}/anchor-retraction",
    DriveExcluded: "map/{map}/drive-exclusion",
    DriveIncluded: "map/{map}/drive-inclusion",
    FixJudged: "veh/{vehicle}/est/fix",
    PoseFiltered: "veh/{vehicle}/est/pose",
    GateAlarmed: "veh/{vehicle}/est/gate",
    LandmarksPerceived: "veh/{vehicle}/perc/landmarks",
    OdometryMatched: "veh/{vehicle}/perc/odometry",
    LoopClosed: "veh/{vehicle}/perc/loop",
    LoopsSought: "veh/{vehicle}/perc/loop-search",
    TrajectorySolved: "map/{map}/trajectory/{vehicle}",
    LandmarkSolved: "map/{map}/lm/{zoom}/{column}/{row}",
    AnchorAssociated: "map/{map}/association",
    ImageOffsetSolved: "map/{map}/image-offset",
    LabelGainSolved: "map/{map}/label-gain",
    MapSolved: "map/{map}/version",
    OdometryCorrected: "veh/{vehicle}/corr/odometry",
}

ASK_PATTERN = "map/{map}/ask/{question}"
TILE_CHANGE_PATTERN = "map/{map}/changes/{zoom}/{column}/{row}"
VERSION_CHANGE_PATTERN = "map/{map}/changes/version"

STREAM_PATTERNS: Mapping[type, str] = {
    VehicleDescribed: "veh-{vehicle}",
    WheelSpeedMeasured: "veh-{vehicle}",
    WheelPairMeasured: "veh-{vehicle}",
    ImuMeasured: "veh-{vehicle}",
    GnssFixReceived: "veh-{vehicle}",
    LandmarksDetected: "veh-{vehicle}",
    PointsScanned: "veh-{vehicle}",
    EventRefused: "refused",
    MapFramePinned: "map",
    AnchorLabelled: "corrections",
    AnchorRetracted: "corrections",
    DriveExcluded: "corrections",
    DriveIncluded: "corrections",
    FixJudged: "filtering",
    PoseFiltered: "filtering",
    GateAlarmed: "filtering",
    LandmarksPerceived: "perception",
    OdometryMatched: "perception",
    LoopClosed: "perception",
    LoopsSought: "perception",
    TrajectorySolved: "optimisation",
    LandmarkSolved: "optimisation",
    AnchorAssociated: "optimisation",
    ImageOffsetSolved: "optimisation",
    LabelGainSolved: "optimisation",
    MapSolved: "optimisation",
    OdometryCorrected: "odometry",
}


def valid_name(name: str) -> str:
    """The name itself, if it can be one chunk of a key and part of a file name. Raises InputError."""
    if not name or len(name) > NAME_LIMIT:
        raise InputError(f"name {name!r} has {len(name)} characters: 1 to {NAME_LIMIT} are allowed")
    forbidden = sorted(set(name) & FORBIDDEN_CHARACTERS)
    if forbidden:
        raise InputError(f"name {name!r} holds {' '.join(forbidden)}: none of * ? # $ / is allowed")
    if name.startswith("@") or not name.isprintable():
        raise InputError(f"name {name!r} starts with @ or holds a character that does not print")
    return name


def vehicle_of(envelope: Envelope[object]) -> str:
    """The vehicle an event is about: the one it names, else its source."""
    event = envelope.event
    if isinstance(event, VEHICLE_NAMING):
        return event.vehicle
    return envelope.identity.source


def stream_of(envelope: Envelope[object]) -> str:
    """The name of the log stream an event belongs to. Raises InputError for a name no file can have."""
    return STREAM_PATTERNS[type(envelope.event)].format(vehicle=valid_name(vehicle_of(envelope)))


def key_of(
    envelope: Envelope[object],
    *,
    root: str = DEFAULT_ROOT,
    map_name: str = DEFAULT_MAP,
    frame: "MapFrame | None" = None,
) -> str:
    """The key an event is published under; a landmark's names its tile, for which `frame` is needed.

    Raises InputError for a name that cannot be a chunk of a key, and for a landmark without `frame`.
    """
    chunks: dict[str, str | int] = {"vehicle": valid_name(vehicle_of(envelope)), "map": valid_name(map_name)}
    if isinstance(envelope.event, LandmarkSolved):
        chunks |= _tile_chunks(envelope.event, frame)
    return f"{valid_name(root)}/{KEY_VERSION}/{KEY_PATTERNS[type(envelope.event)].format(**chunks)}"


def key_expression(event_class: type, *, root: str = DEFAULT_ROOT) -> str:
    """The expression that matches every key of a class of events: `*` for each name."""
    wild = dict.fromkeys(("vehicle", "map", "zoom", "column", "row"), "*")
    return f"{valid_name(root)}/{KEY_VERSION}/{KEY_PATTERNS[event_class].format(**wild)}"


def map_key(
    pattern: str,
    *,
    root: str = DEFAULT_ROOT,
    map_name: str = DEFAULT_MAP,
    chunks: Mapping[str, str | int] = MappingProxyType({}),
) -> str:
    """A key of one map that is no event's: where it is asked, or told of its changes; a chunk `*` matches any.

    Raises InputError for a name that cannot be a chunk of a key.
    """
    return f"{valid_name(root)}/{KEY_VERSION}/{pattern.format(map=valid_name(map_name), **chunks)}"


def _tile_chunks(landmark: LandmarkSolved, frame: "MapFrame | None") -> dict[str, int]:
    from trigpoint.geodesy.projection import wgs84_from_map  # here: vehicles name no tiles and do without pyproj

    if frame is None:
        raise InputError(f"landmark {landmark.landmark!r}: its key names a tile, and no map frame was given")
    position = MapPosition(float(landmark.position_m[0]), float(landmark.position_m[1]))
    tile = tile_at(wgs84_from_map(position, frame), LANDMARK_ZOOM)
    return {"zoom": tile.zoom, "column": tile.column, "row": tile.row}

"""What of a landmark map is shown as layers: their features' geometry, properties and identity."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Kind = Literal["string", "number", "integer", "boolean", "array"]
Geometry = Literal["Point", "LineString", ""]  # "": none


@dataclass(frozen=True, slots=True)
class Property:
    """A property of a layer's features; `kind` is JSON's word for its values, any of which may be null."""

    name: str
    kind: Kind
    description: str

    @property
    def comparable(self) -> bool:
        """Whether conditions can be put on it."""
        return self.kind != "array"


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """A layer: `times` are the properties, in ns, a feature's first and last moment are in, None where it has none."""

    name: str
    title: str
    description: str
    geometry: Geometry
    properties: tuple[Property, ...]
    times: tuple[str, str] | None = None
    stored: bool = True

    @property
    def tiled(self) -> bool:
        """Whether there are vector tiles of it."""
        return self.geometry != "" and self.stored

    def property_named(self, name: str) -> Property | None:
        """The property of a name, None where there is none."""
        return next((one for one in self.properties if one.name == name), None)


def _text(name: str, description: str) -> Property:
    return Property(name, "string", description)


def _real(name: str, description: str) -> Property:
    return Property(name, "number", description)


def _whole(name: str, description: str) -> Property:
    return Property(name, "integer", description)


SIGNATURE = _text("signature", "What tells it from others of its kind, where that is known")
COVARIANCE = Property("covariance_m2", "array", "Covariance in m^2, rows and columns grid east and grid north")
VERSION = _whole("map_version", "The map version it was solved in")
VEHICLE = _text("vehicle", "The vehicle")
BOOT = _text("boot_id", "The vehicle's boot")
EASTING, NORTHING = _real("easting_m", "Easting in the map's CRS"), _real("northing_m", "Northing in the map's CRS")

LANDMARKS = Layer(
    name="landmarks",
    title="Landmarks",
    description="Landmarks with covariance, valid in a map version",
    geometry="Point",
    times=("first_seen_ns", "last_seen_ns"),
    properties=(
        _text("landmark", "Its id, the same from version to version"),
        _text("kind", "What it is, as pole or corner"),
        SIGNATURE,
        _real("x_m", "Metres along grid east from the map's origin"),
        _real("y_m", "Metres along grid north from the map's origin"),
        EASTING,
        NORTHING,
        COVARIANCE,
        _real("sigma_major_m", "Longer semi-axis of the 1-sigma ellipse"),
        _real("sigma_minor_m", "Shorter semi-axis of the 1-sigma ellipse"),
        _real("ellipse_heading_rad", "Of the longer semi-axis, counter-clockwise from grid east"),
        _whole("observation_count", "How often it was observed"),
        Property("vehicles", "array", "The vehicles that observed it"),
        _whole("first_seen_ns", "First observation, nanoseconds since 1970"),
        _whole("last_seen_ns", "Last observation, nanoseconds since 1970"),
        Property("anchored", "boolean", "Whether an anchor is tied to it"),
        Property("anchors", "array", "The anchors tied to it"),
        _whole("valid_from_version", "The first map version it is so in"),
        _whole("valid_to_version", "The first map version it is not so in any more; null: it still is"),
    ),
)
TRAJECTORIES = Layer(
    name="trajectories",
    title="Trajectories",
    description="The path of each drive, as solved",
    geometry="LineString",
    times=("first_stamp_ns", "last_stamp_ns"),
    properties=(
        VEHICLE,
        BOOT,
        VERSION,
        _whole("first_stamp_ns", "Its first pose, nanoseconds since 1970"),
        _whole("last_stamp_ns", "Its last pose, nanoseconds since 1970"),
        _whole("pose_count", "How many poses it has"),
        _real("length_m", "Its length in metres of the grid"),
        Property("calibration", "array", "[name, value, sigma] of each calibration state"),
    ),
)
ANCHORS = Layer(
    name="anchors",
    title="Anchors",
    description="Positions labelled in aerial images, and what became of them",
    geometry="Point",
    properties=(
        _text("anchor", "Its name"),
        _text("image", "The image it was labelled in; empty: a survey"),
        _text("kind", "What it is, as pole or corner"),
        SIGNATURE,
        _text("landmark", "The landmark it is tied to; empty: none"),
        _text("reason", "Why it is tied to none"),
        _real("sigma_m", "1-sigma of the label per axis"),
        _real("residual_x_m", "Label minus landmark minus image offset, along grid east"),
        _real("residual_y_m", "Label minus landmark minus image offset, along grid north"),
        _real("residual_m", "The residual's length"),
        EASTING,
        NORTHING,
        VERSION,
    ),
)
IMAGE_OFFSETS = Layer(
    name="image_offsets",
    title="Image offsets",
    description="Each aerial image's own offset: label minus true position",
    geometry="",
    properties=(
        _text("image", "The image"),
        _real("offset_x_m", "Along grid east"),
        _real("offset_y_m", "Along grid north"),
        COVARIANCE,
        VERSION,
    ),
)
DRIVES = Layer(
    name="drives",
    title="Drives",
    description="What was driven, and whether the map is solved with it",
    geometry="",
    times=("start_ns", "end_ns"),
    stored=False,
    properties=(
        VEHICLE,
        BOOT,
        _whole("start_ns", "Its beginning, nanoseconds since 1970"),
        _whole("end_ns", "Its end, nanoseconds since 1970"),
        Property("excluded", "boolean", "Whether the map is solved without it"),
        _text("author", "Who excluded it, or included it again"),
        _text("reason", "Why"),
    ),
)
LAYERS: Mapping[str, Layer] = {layer.name: layer for layer in (LANDMARKS, TRAJECTORIES, ANCHORS, DRIVES, IMAGE_OFFSETS)}


def drive_id(vehicle: str, boot_id: str) -> str:
    """The id of a drive and of its trajectory."""
    return f"{vehicle}:{boot_id}"


def anchor_id(anchor: str, image: str) -> str:
    """The id of an anchor: its name, and the image it was labelled in if there is one."""
    return f"{anchor}@{image}" if image else anchor

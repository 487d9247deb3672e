"""The manifest that says what the columns of somebody's tables mean."""

import tomllib
from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, BeforeValidator, Field, ValidationError, model_validator

from trigpoint.errors import InputError
from trigpoint.geodesy.positions import GridPosition, Wgs84Position
from trigpoint_vehicle.core.manifest_quantities import (
    AsAcceleration,
    AsAngle,
    AsDegrees,
    AsLength,
    AsSpeed,
    AsTurnRate,
    AsWords,
    ManifestPart,
    Words,
)
from trigpoint_vehicle.core.source_frames import (
    SourceFrame,
    geographic_frame,
    local_frame_at,
    local_frame_on_grid,
    projected_frame,
)
from trigpoint_vehicle.core.source_times import GPS_EPOCH, UNIX_EPOCH, TimeScale, TimeUnit

EPOCH_YEARS = (1900, 2100)  # the first and the last: what is counted from them fits 64-bit nanoseconds
SENSOR_LENGTH = 200  # characters
VEHICLE_NAME = r"^[A-Za-z0-9][A-Za-z0-9_.-]*$"  # a file's name and part of a key on the bus


class Clock(ManifestPart):
    """What second 0 of a time column is, and whether it counts leap seconds."""

    epoch: AwareDatetime | None = None
    scale: TimeScale = "utc"

    @model_validator(mode="after")
    def _is_near(self) -> Self:
        if not EPOCH_YEARS[0] <= self.second_zero().year <= EPOCH_YEARS[1]:
            raise ValueError(f"epoch {self.second_zero()} is outside the years {EPOCH_YEARS[0]} to {EPOCH_YEARS[1]}")
        return self

    def second_zero(self) -> datetime:
        """The instant the clock's 0 is named by."""
        return self.epoch or (GPS_EPOCH if self.scale == "gps" else UNIX_EPOCH)


class TimeColumn(ManifestPart):
    """A column of times; `offset_s` is added, e.g. -0.1 for a sensor that reports a tenth of a second late."""

    column: str
    unit: TimeUnit = "s"
    offset_s: float = 0.0


class Frame(ManifestPart):
    """What positions are given in: degrees, a projected CRS, or metres from an origin."""

    kind: Literal["geographic", "projected", "local"]
    crs: str = ""
    origin_lat_deg: float | None = None
    origin_lon_deg: float | None = None
    origin_easting_m: float | None = None
    origin_northing_m: float | None = None

    @model_validator(mode="after")
    def _is_placed(self) -> Self:
        if self.kind == "projected" and not self.crs:
            raise ValueError("a projected frame needs its crs")
        if self.kind == "local" and (self.on_earth is None) == (self.on_grid is None):
            raise ValueError(
                "a local frame needs either origin_lat_deg and origin_lon_deg (axes to true east and north), "
                "or crs, origin_easting_m and origin_northing_m (axes along that grid)"
            )
        return self

    @property
    def on_earth(self) -> Wgs84Position | None:
        """The origin in degrees, if that is how it is given."""
        if self.origin_lat_deg is None or self.origin_lon_deg is None:
            return None
        return Wgs84Position(self.origin_lat_deg, self.origin_lon_deg)

    @property
    def on_grid(self) -> GridPosition | None:
        """The origin on the grid of `crs`, if that is how it is given."""
        if not self.crs or self.origin_easting_m is None or self.origin_northing_m is None:
            return None
        return GridPosition(self.origin_easting_m, self.origin_northing_m)

    def source_frame(self) -> SourceFrame:
        """The frame as coordinates are changed by. Raises FrameRefused."""
        if self.kind == "geographic":
            return geographic_frame(self.crs) if self.crs else geographic_frame()
        if self.kind == "projected":
            return projected_frame(self.crs)
        if self.on_earth is not None:
            return local_frame_at(self.on_earth)
        assert self.on_grid is not None  # the validator saw to it
        return local_frame_on_grid(self.crs, self.on_grid)


class FilePart(ManifestPart):
    """Where a part's rows stand. Without `file` the vehicle's own; without `columns` the first row names them."""

    file: str = ""
    delimiter: str = ","
    comment: str = "#"
    columns: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _delimits(self) -> Self:
        if self.delimiter != "whitespace" and len(self.delimiter) != 1:
            raise ValueError(f"delimiter {self.delimiter!r} is neither one character nor 'whitespace'")
        return self


class PositionPart(FilePart):
    """Rows with a position: `lat` and `lon`, or `east` and `north`. `frame` replaces the manifest's."""

    lat: AsDegrees | None = None
    lon: AsDegrees | None = None
    east: AsLength | None = None
    north: AsLength | None = None
    frame: Frame | None = None

    @model_validator(mode="after")
    def _has_position(self) -> Self:
        degrees, metres = (self.lat, self.lon), (self.east, self.north)
        if (
            (None in degrees) == (None in metres)
            or (None in degrees and any(degrees))
            or (None in metres and any(metres))
        ):
            raise ValueError("give either lat and lon or east and north")
        return self


def _time(given: object) -> object:
    return {"column": given} if isinstance(given, str) else given


def _listed(given: object) -> object:
    return [given] if isinstance(given, dict) else given


AsTime = Annotated[TimeColumn, BeforeValidator(_time)]
Triple = tuple[float, float, float]


class Fixes(PositionPart):
    """A receiver's fixes; `sigma` is its own 1-sigma per axis."""

    time: AsTime
    height: AsLength | None = None
    sigma: AsLength | None = None


class WheelSpeeds(FilePart):
    """Speed of the base or of one wheel, with a steering angle or a rate of turn to the left, if any."""

    time: AsTime
    speed: AsSpeed
    steering: AsAngle | None = None
    yaw_rate: AsTurnRate | None = None


class WheelPairs(FilePart):
    """Speeds of a left and a right wheel."""

    time: AsTime
    left: AsSpeed
    right: AsSpeed


class Inertial(FilePart):
    """Rate of turn to the left, and accelerations ahead and to the left, if any."""

    time: AsTime
    yaw_rate: AsTurnRate
    acceleration_x: AsAcceleration | None = None
    acceleration_y: AsAcceleration | None = None


class Detections(FilePart):
    """Landmarks seen: `range` and `bearing` in the sensor's frame, or `x` ahead and `y` left in the vehicle's.

    Rows of one time are one sweep; a row without numbers is a sweep that saw nothing.
    """

    time: AsTime
    range: AsLength | None = None
    bearing: AsAngle | None = None
    x: AsLength | None = None
    y: AsLength | None = None
    kind: AsWords = Words(value="pole")
    signature: AsWords = Words(value="")
    diameter: AsLength | None = None

    @model_validator(mode="after")
    def _has_place(self) -> Self:
        polar, plane = (self.range, self.bearing), (self.x, self.y)
        if (None in polar) == (None in plane) or (None in polar and any(polar)) or (None in plane and any(plane)):
            raise ValueError("give either range and bearing or x and y")
        return self


class Sweeps(FilePart):
    """A lidar's scans, a file each: `file` has a row a scan, its path in column `scan`; or `file` is a pattern such as
    `scans/*.pcd`, whose files are the rows and their names without suffix the column `stem`.

    The lidar stands at `position_m` in the base frame (z up from the ground), turned by roll about x, then pitch about
    y, then yaw about z; without `position_m` PCD files say it, each by its line VIEWPOINT. `origin_m` is taken off the
    coordinates of LAS files. `point_times` "gps_time": these say of each point when it was measured, and `time` is the
    first point's.
    """

    time: AsTime
    scan: str = "scan"
    sensor: str = Field(default="lidar", max_length=SENSOR_LENGTH)
    position_m: Triple | None = None
    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    yaw_deg: float = 0.0
    origin_m: Triple = (0.0, 0.0, 0.0)
    point_times: Literal["none", "gps_time"] = "none"

    @model_validator(mode="after")
    def _is_turned_where_it_stands(self) -> Self:
        turned = sorted(self.model_fields_set & {"roll_deg", "pitch_deg", "yaw_deg"})
        if self.position_m is None and turned:
            raise ValueError(f"{', '.join(turned)} without position_m")
        return self


class Heading(ManifestPart):
    """A heading: from which axis of the frame it counts, and which way round."""

    column: str
    unit: Literal["rad", "deg"] = "rad"
    zero: Literal["east", "north"] = "east"
    turn: Literal["counter-clockwise", "clockwise"] = "counter-clockwise"


class TruePath(PositionPart):
    """A vehicle's true path."""

    time: AsTime
    heading: Annotated[Heading, BeforeValidator(_time)] | None = None


class Anchors(PositionPart):
    """Surveyed points: `sigma` 1-sigma per axis inside their image, `image_sigma` that of the image itself."""

    name: AsWords
    sigma: AsLength
    image: AsWords = Words(value="survey")
    image_sigma: AsLength | None = None
    kind: AsWords = Words(value="")
    signature: AsWords = Words(value="")


class TrueLandmarks(PositionPart):
    """Landmarks' true positions."""

    name: AsWords
    signature: AsWords = Words(value="")


class Geometry(ManifestPart):
    """A vehicle's geometry in metres and radians: base at the middle of the rear axle, x ahead, y left."""

    wheelbase_m: float = 0.0
    track_m: float = 0.0
    speed_wheel_y_m: float = 0.0
    antenna_x_m: float = 0.0
    antenna_y_m: float = 0.0
    landmark_sensor_x_m: float = 0.0
    landmark_sensor_y_m: float = 0.0
    landmark_sensor_yaw_rad: float = 0.0
    landmark_sensor_range_m: float = 0.0
    landmark_sensor_model: Literal["", "camera"] = ""


class Vehicle(ManifestPart):
    """One vehicle's drive. `file` and `clock` serve all its parts that name none."""

    name: str = Field(pattern=VEHICLE_NAME)
    file: str = ""
    clock: Clock | None = None
    geometry: Geometry = Geometry()
    fixes: Annotated[tuple[Fixes, ...], BeforeValidator(_listed)] = ()
    wheel_speeds: Annotated[tuple[WheelSpeeds, ...], BeforeValidator(_listed)] = ()
    wheel_pairs: Annotated[tuple[WheelPairs, ...], BeforeValidator(_listed)] = ()
    inertial: Annotated[tuple[Inertial, ...], BeforeValidator(_listed)] = ()
    detections: Annotated[tuple[Detections, ...], BeforeValidator(_listed)] = ()
    sweeps: Annotated[tuple[Sweeps, ...], BeforeValidator(_listed)] = ()
    true_path: Annotated[tuple[TruePath, ...], BeforeValidator(_listed)] = ()

    def parts(self) -> tuple[FilePart, ...]:
        """All parts that read rows."""
        parts: tuple[FilePart, ...] = (*self.fixes, *self.wheel_speeds, *self.wheel_pairs, *self.inertial)
        return (*parts, *self.detections, *self.sweeps, *self.true_path)

    @model_validator(mode="after")
    def _has_files(self) -> Self:
        if not self.file and any(not part.file for part in self.parts()):
            raise ValueError(f"vehicle {self.name!r} has no file, and a part of it names none either")
        if self.sweeps and not (self.fixes or self.wheel_speeds or self.wheel_pairs):
            raise ValueError(
                f"vehicle {self.name!r} has sweeps without a path: neither fixes nor wheel_speeds nor pairs"
            )
        if self.wheel_pairs and self.geometry.track_m <= 0.0:
            raise ValueError(f"vehicle {self.name!r} has wheel_pairs, so its geometry needs track_m above 0")
        return self


class Manifest(ManifestPart):
    """Everything there is to know about some tables. `data_dir` is where their paths begin, from the manifest on."""

    title: str = ""
    data_dir: str = "."
    map_crs: str = ""
    clock: Clock = Clock()
    frame: Frame = Frame(kind="geographic")
    vehicle: tuple[Vehicle, ...] = Field(min_length=1)
    anchors: Annotated[tuple[Anchors, ...], BeforeValidator(_listed)] = ()
    true_landmarks: Annotated[tuple[TrueLandmarks, ...], BeforeValidator(_listed)] = ()

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        names = [vehicle.name for vehicle in self.vehicle]
        if len(set(names)) < len(names):
            raise ValueError(f"a vehicle's name stands twice in {', '.join(names)}")
        if any(not part.file for part in (*self.anchors, *self.true_landmarks)):
            raise ValueError("anchors and true_landmarks need a file")
        return self

    def files(self) -> tuple[str, ...]:
        """Every file named, once, in order of first mention."""
        owned = [part.file or vehicle.file for vehicle in self.vehicle for part in vehicle.parts()]
        shared: Sequence[FilePart] = (*self.anchors, *self.true_landmarks)
        return tuple(dict.fromkeys([*owned, *(part.file for part in shared)]))


def parsed_manifest(name: str, text: str) -> Manifest:
    """The manifest of a TOML text. Raises InputError naming every key that is wrong."""
    try:
        return Manifest.model_validate(tomllib.loads(text))
    except ValidationError as error:
        raise InputError(f"{name}: {'; '.join(map(_complaint, error.errors()))}") from None
    except (ValueError, RecursionError) as error:  # no TOML, numbers of thousands of digits, brackets without end
        raise InputError(f"{name}: not TOML: {error}") from None


def _complaint(error: object) -> str:
    assert isinstance(error, dict)
    place = ".".join(str(step) for step in error["loc"]) or "manifest"
    given = "" if isinstance(error["input"], dict | list) else f", not {error['input']!r}"
    return f"{place}: {error['msg']}{given}"

"""The landmark map as values: what a map version holds, and what changes from one version to the next."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.envelope import LogPosition

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class MapVersion:
    """One solved map version: how it was solved, in which frame, and where its MapSolved event stands in the log.

    `base_version` 0: it was solved whole; else its events said only what differs from that version.
    `inputs_json` is a list of [stream, count]: the log was solved up to there. `solved_ns` is the event's stamp.
    """

    map_version: int
    base_version: int
    method: str
    settings_json: str
    inputs_json: str
    landmark_count: int
    anchor_count: int
    wall_s: float
    solved_ns: int
    log_stream: str
    log_number: int
    crs: str
    origin_easting_m: float
    origin_northing_m: float
    operation: str
    operation_accuracy_m: float


class Landmark(NamedTuple):
    """One landmark as it stood over the half-open range of map versions [valid_from_version, valid_to_version).

    `landmark` is its id, stable between versions. x, y in the map frame; easting, northing in the map's CRS;
    latitude and longitude on WGS84. Variances and covariance along grid east (x) and grid north (y); sigma_* are
    the semi-axes of the 1-sigma ellipse, `ellipse_heading_rad` of the longer one counter-clockwise from grid east.
    `provenance` is JSON, {"vehicle/boot": [sequences of the sweeps that saw it]}; in a version upon another, of those
    that did since the landmark's row before, else of all. `valid_to_version` None: still valid.

    A named tuple because a million of them are made, compared and copied in one replay; it is made by keyword.
    """

    landmark: str
    kind: str
    signature: str
    x_m: float
    y_m: float
    easting_m: float
    northing_m: float
    lat_deg: float
    lon_deg: float
    variance_x_m2: float
    covariance_xy_m2: float
    variance_y_m2: float
    sigma_major_m: float
    sigma_minor_m: float
    ellipse_heading_rad: float
    observation_count: int
    vehicles: tuple[str, ...]
    first_seen_ns: int
    last_seen_ns: int
    anchored: bool
    anchors: tuple[str, ...]
    provenance: str
    valid_from_version: int
    valid_to_version: int | None

    def says_the_same_as(self, other: "Landmark") -> bool:
        """Whether the two are the same in everything but the map versions they are valid in."""
        return self[:-2] == other[:-2]

    def until(self, map_version: int) -> "Landmark":
        """The same, no longer valid from a version on."""
        return Landmark(*self[:-1], map_version)

    @property
    def covariance_m2(self) -> Floats:
        """The position's covariance (2, 2) in m^2, rows and columns grid east, grid north."""
        return np.array(
            [[self.variance_x_m2, self.covariance_xy_m2], [self.covariance_xy_m2, self.variance_y_m2]], dtype=np.float64
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """One drive's path in one map version; `path` are easting, northing in metres of the map's CRS.

    `calibration_json` is a list of [name, value, sigma] of the drive's calibration states.
    """

    map_version: int
    vehicle: str
    boot_id: str
    first_stamp_ns: int
    last_stamp_ns: int
    pose_count: int
    length_m: float
    calibration_json: str
    path: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Anchor:
    """What became of one anchor in one map version, where its label lies.

    `landmark` is the one it was tied to, or "" and `reason` says why not. Residual: label minus landmark minus
    image offset; None where the anchor was not tied. Positions are None where no label of that name was among
    the inputs of the version.
    """

    map_version: int
    anchor: str
    image: str
    kind: str
    signature: str
    landmark: str
    reason: str
    sigma_m: float | None
    residual_x_m: float | None
    residual_y_m: float | None
    residual_m: float | None
    lat_deg: float | None
    lon_deg: float | None
    easting_m: float | None
    northing_m: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageOffset:
    """An aerial image's own offset in one map version: label minus true position, along grid east and north."""

    map_version: int
    image: str
    offset_x_m: float
    offset_y_m: float
    variance_x_m2: float
    covariance_xy_m2: float
    variance_y_m2: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelGain:
    """What one more label in an image ("": in none the map knows the offset of) would tell of one whole map version.

    `landmarks_json` is a list of ids; `terms_json` of each of them [xx, xy, yy of `expected_m2`, xx, xy, yy of
    `shared_m4`], as `LabelGainSolved` has them.
    """

    map_version: int
    image: str
    landmarks_json: str
    terms_json: str


MapRow = MapVersion | Landmark | Trajectory | Anchor | ImageOffset | LabelGain


@dataclass(frozen=True, slots=True, kw_only=True)
class MapChange:
    """Everything one map version changes: `closed` are the ids whose valid landmark ends with this version,
    `opened` the landmarks valid from it on. A landmark in neither stays as it is."""

    version: MapVersion
    opened: tuple[Landmark, ...]
    closed: tuple[str, ...]
    trajectories: tuple[Trajectory, ...]
    anchors: tuple[Anchor, ...]
    image_offsets: tuple[ImageOffset, ...]
    label_gains: tuple[LabelGain, ...] = ()


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """How far each stream of the log has been taken in: the first number that has not."""

    next_numbers: tuple[tuple[str, int], ...] = ()

    def next_number(self, stream: str) -> int:
        """The first number of a stream not taken in; 0 for a stream never seen."""
        return dict(self.next_numbers).get(stream, 0)

    def after(self, position: LogPosition) -> "Checkpoint":
        """The checkpoint once the event at `position` is taken in."""
        moved = dict(self.next_numbers) | {position.stream: position.number + 1}
        return Checkpoint(tuple(sorted(moved.items())))


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarkChanges:
    """What someone who holds the map of version `since` needs to hold that of `as_of`."""

    since: int
    as_of: int
    changed: tuple[Landmark, ...]
    removed: tuple[str, ...]


def provenance_json(observations: Mapping[tuple[str, str], Sequence[int]]) -> str:
    """The text a landmark keeps of its observations: of each drive (vehicle, boot) the sequences of the sweeps."""
    # A list of whole numbers reads the same in JSON as in Python; there are too many of these for an encoder.
    return "{" + ", ".join(f"{_drive_json(drive)}: {list(sweeps)}" for drive, sweeps in observations.items()) + "}"


@lru_cache(maxsize=4096)
def _drive_json(drive: tuple[str, str]) -> str:
    return json.dumps("/".join(drive), ensure_ascii=False)


def valid_at(landmark: Landmark, map_version: int) -> bool:
    """Whether a landmark's row is part of a map version."""
    ends = landmark.valid_to_version
    return landmark.valid_from_version <= map_version and (ends is None or map_version < ends)


def changes_between(
    before: Sequence[Landmark], after: Sequence[Landmark], *, since: int, as_of: int
) -> LandmarkChanges:
    """The difference between two answers to the same query at two versions."""
    opened_at = {landmark.landmark: landmark.valid_from_version for landmark in before}
    held = {landmark.landmark for landmark in after}
    return LandmarkChanges(
        since=since,
        as_of=as_of,
        changed=tuple(row for row in after if opened_at.get(row.landmark) != row.valid_from_version),
        removed=tuple(sorted(opened_at.keys() - held)),
    )

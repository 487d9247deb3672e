"""What the HTTP service needs of the event log; whoever composes the services provides it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.geodesy.projection import MapFrame

PathSource = Literal["odometry", "filtered"]


class NoSuchName(InputError):
    """An anchor or a drive that is not there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveRow:
    """A drive in the log and whether the map is solved with it; None: nobody has said anything of it."""

    vehicle: str
    boot_id: str
    start_ns: int
    end_ns: int
    excluded: bool
    author: str | None
    reason: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class NewLabel:
    """A position labelled in an image, in degrees on WGS84; a sigma of None is what is usual."""

    anchor: str
    image: str
    lat_deg: float
    lon_deg: float
    sigma_m: float | None
    image_sigma_m: float | None
    kind: str
    signature: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelRow:
    """A label in force in the log, in degrees on WGS84; `stamp_ns`: when it was labelled."""

    anchor: str
    image: str
    lat_deg: float
    lon_deg: float
    sigma_m: float
    image_sigma_m: float
    kind: str
    signature: str
    stamp_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivenPath:
    """A drive's path by its odometry alone or by the filter: point_m (n, 2) in the map frame, stamp_ns (n,)."""

    vehicle: str
    boot_id: str
    stamp_ns: NDArray[np.int64]
    point_m: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedFix:
    """A GNSS fix and the filter's verdict on it; numbers that are not known are None."""

    vehicle: str
    boot_id: str
    fix_sequence: int
    stamp_ns: int
    lat_deg: float
    lon_deg: float
    sigma_m: float | None
    accepted: bool
    reason: str
    nis: float | None
    limit: float | None
    innovation_x_m: float | None
    innovation_y_m: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Appended:
    """What came of a correction: how many events are new in the log, and how many said what stood there already."""

    appended: int
    known: int


class MapCorrections(Protocol):
    """The corrections of a map, each durable when its method returns. Methods block; they may be called from threads.

    All raise InputError for a value out of its limits, NoSuchName for a name that is not there, and ServiceError where
    the log cannot be written.
    """

    def drives(self) -> Sequence[DriveRow]:
        """Every drive in the log, in order of vehicle and time."""

    def labels(self) -> Sequence[LabelRow]:
        """The labels in force, those no version has taken in yet among them, first labelled first."""

    def label(self, label: NewLabel) -> Appended:
        """The label in the log; one that says what is in force already changes nothing."""

    def retract(self, anchor: str, *, image: str | None, author: str, reason: str) -> Appended:
        """The anchor taken back; `image` None: the only one it is in."""

    def exclude(self, vehicle: str, *, boot_id: str | None, author: str, reason: str) -> Appended:
        """The vehicle's drive of a boot left out of the map; None: all its drives."""

    def include(self, vehicle: str, *, boot_id: str | None, author: str, reason: str) -> Appended:
        """The vehicle's drive of a boot let in again; None: all that are left out."""


class MeasuredDrives(Protocol):
    """What the log holds of drives beside the map. Methods block; they may be called from threads.

    All raise ServiceError where the log cannot be read.
    """

    def frame(self) -> MapFrame | None:
        """The map's frame, None before it is pinned."""

    def paths(self, source: PathSource) -> Sequence[DrivenPath]:
        """The drives' paths in order of vehicle and time; by odometry each begins where the map, or the filter, has its
        first pose, and goes on by the wheels' word alone; one without such a pose is left out."""

    def fixes(self) -> Sequence[JudgedFix]:
        """Every fix with a verdict, in order of vehicle, boot and number."""

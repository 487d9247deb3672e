"""What the HTTP service needs of the event log; whoever composes the services provides it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from trigpoint.errors import InputError


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

    def label(self, label: NewLabel) -> Appended:
        """The label in the log; one that says what is in force already changes nothing."""

    def retract(self, anchor: str, *, image: str | None, author: str, reason: str) -> Appended:
        """The anchor taken back; `image` None: the only one it is in."""

    def exclude(self, vehicle: str, *, boot_id: str | None, author: str, reason: str) -> Appended:
        """The vehicle's drive of a boot left out of the map; None: all its drives."""

    def include(self, vehicle: str, *, boot_id: str | None, author: str, reason: str) -> Appended:
        """The vehicle's drive of a boot let in again; None: all that are left out."""

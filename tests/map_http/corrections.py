"""Corrections kept in memory, under the rules of the log's."""

from collections.abc import Sequence

from trigpoint.errors import InputError
from trigpoint_landmarks.http.ports import Appended, DriveRow, NewLabel, NoSuchName

DRIVES = (
    DriveRow(vehicle="veh-a", boot_id="b1", start_ns=10, end_ns=20, excluded=False, author=None, reason=None),
    DriveRow(vehicle="veh-a", boot_id="b2", start_ns=30, end_ns=40, excluded=True, author="ann", reason="fog"),
    DriveRow(vehicle="veh-b", boot_id="b1", start_ns=50, end_ns=60, excluded=False, author=None, reason=None),
)


class MemoryCorrections:
    """MapCorrections that are gone with their process; `said` is what they were told, in order."""

    def __init__(self) -> None:
        self.said: list[tuple[object, ...]] = []
        self.labels: dict[str, NewLabel] = {}

    def drives(self) -> Sequence[DriveRow]:
        return DRIVES

    def label(self, label: NewLabel) -> Appended:
        if label.anchor == "far":
            raise InputError("too far: anchor 'far'")
        known = self.labels.get(label.anchor) == label
        self.labels[label.anchor] = label
        self.said.append(("label", label.anchor))
        return Appended(appended=int(not known), known=int(known))

    def retract(self, anchor: str, *, image: str | None, author: str, reason: str) -> Appended:
        if anchor not in self.labels:
            raise NoSuchName(f"anchor {anchor!r}: nobody labelled one of that name")
        del self.labels[anchor]
        self.said.append(("retract", anchor, image, author, reason))
        return Appended(appended=1, known=0)

    def exclude(self, vehicle: str, *, boot_id: str | None, author: str, reason: str) -> Appended:
        return self._on_drive("exclude", vehicle, boot_id, author, reason)

    def include(self, vehicle: str, *, boot_id: str | None, author: str, reason: str) -> Appended:
        return self._on_drive("include", vehicle, boot_id, author, reason)

    def _on_drive(self, what: str, vehicle: str, boot_id: str | None, author: str, reason: str) -> Appended:
        if vehicle not in {one.vehicle for one in DRIVES}:
            raise NoSuchName(f"vehicle {vehicle!r} has no drive in the log")
        self.said.append((what, vehicle, boot_id, author, reason))
        return Appended(appended=1, known=0)

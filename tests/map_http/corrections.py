"""Corrections kept in memory, under the rules of the log's."""

from collections.abc import Sequence

from trigpoint.errors import InputError
from trigpoint_landmarks.http.ports import Appended, DriveRow, LabelRow, NewLabel, NoSuchName

DRIVES = (
    DriveRow(vehicle="veh-a", boot_id="b1", start_ns=10, end_ns=20, excluded=False, author=None, reason=None),
    DriveRow(vehicle="veh-a", boot_id="b2", start_ns=30, end_ns=40, excluded=True, author="ann", reason="fog"),
    DriveRow(vehicle="veh-b", boot_id="b1", start_ns=50, end_ns=60, excluded=False, author=None, reason=None),
)


class MemoryCorrections:
    """MapCorrections that are gone with their process; `said` is what they were told, in order."""

    def __init__(self) -> None:
        self.said: list[tuple[object, ...]] = []
        self.labels_by_name: dict[str, NewLabel] = {}

    def drives(self) -> Sequence[DriveRow]:
        return DRIVES

    def labels(self) -> Sequence[LabelRow]:
        return [
            LabelRow(
                anchor=one.anchor,
                image=one.image,
                lat_deg=one.lat_deg,
                lon_deg=one.lon_deg,
                sigma_m=one.sigma_m or 0.0,
                image_sigma_m=one.image_sigma_m or 0.0,
                kind=one.kind,
                signature=one.signature,
                stamp_ns=number,
            )
            for number, one in enumerate(self.labels_by_name.values())
        ]

    def label(self, label: NewLabel) -> Appended:
        if label.anchor == "far":
            raise InputError("too far: anchor 'far'")
        known = self.labels_by_name.get(label.anchor) == label
        self.labels_by_name[label.anchor] = label
        self.said.append(("label", label.anchor))
        return Appended(appended=int(not known), known=int(known))

    def retract(self, anchor: str, *, image: str | None, author: str, reason: str) -> Appended:
        if anchor not in self.labels_by_name:
            raise NoSuchName(f"anchor {anchor!r}: nobody labelled one of that name")
        del self.labels_by_name[anchor]
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

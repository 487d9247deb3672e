"""Corrections of the map by way of the HTTP service, into the log by the same functions as the commands."""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import cast

from trigpoint.errors import InputError
from trigpoint.events.corrected import AnchorLabelled, Corrected, anchors_in_force
from trigpoint.geodesy.projection import WGS84
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.readings import LABEL_STREAM, logged_frame, pinned_frame
from trigpoint_cli.data_dir import DataDirectory
from trigpoint_ingest.anchors import import_anchors
from trigpoint_ingest.core.anchors import AnchorRow, LabelledAnchors, labelled, near_map
from trigpoint_ingest.core.standing import DriveStanding
from trigpoint_ingest.corrections import (
    Attribution,
    CorrectionReport,
    exclude_drives,
    include_drives,
    logged_anchor_standings,
    logged_drive_standings,
    retract_anchor,
)
from trigpoint_landmarks.http.ports import Appended, DriveRow, LabelRow, NewLabel, NoSuchName


class LoggedCorrections:
    """MapCorrections into the log of a data directory, opened for each: a stream has one writer at a time."""

    def __init__(self, data: DataDirectory) -> None:
        self._data = data

    def drives(self) -> Sequence[DriveRow]:
        """Every drive in the log."""
        with self._data.new_log() as log:
            return [_drive_row(one) for one in logged_drive_standings(log)]

    def labels(self) -> Sequence[LabelRow]:
        """The labels in force."""
        with self._data.new_log() as log:
            rows = [(row.envelope.stamp_ns, cast(Corrected, row.envelope.event)) for row in log.read(LABEL_STREAM)]
        labelled_ns = {id(event): stamp_ns for stamp_ns, event in rows}
        in_force = anchors_in_force(event for _, event in rows)
        return [_label_row(one, stamp_ns=labelled_ns[id(one)]) for one in in_force]

    def label(self, label: NewLabel) -> Appended:
        """The label in the log. One that is refused is not kept aside, as a file's is: whoever sent it is told."""
        found = labelled([_anchor_row(label)])
        with self._data.new_log() as log:
            _require_taken(found)
            if pinned_frame(log) is not None:
                _require_taken(near_map(found.anchors, logged_frame(log)))
            report = import_anchors(found, log, stamp_ns=time.time_ns())
        return Appended(appended=report.added, known=report.known)

    def retract(self, anchor: str, *, image: str | None, author: str, reason: str) -> Appended:
        """The anchor taken back."""
        with self._data.new_log() as log:
            if not any(one.label.anchor == anchor for one in logged_anchor_standings(log)):
                raise NoSuchName(f"anchor {anchor!r}: nobody labelled one of that name")
            return _appended(retract_anchor(log, anchor, image=image, by=_by(author, reason)))

    def exclude(self, vehicle: str, *, boot_id: str | None, author: str, reason: str) -> Appended:
        """The vehicle's drives left out of the map."""
        with self._with_drives_of(vehicle) as log:
            return _appended(exclude_drives(log, vehicle, boot_id=boot_id, by=_by(author, reason)))

    def include(self, vehicle: str, *, boot_id: str | None, author: str, reason: str) -> Appended:
        """The vehicle's drives let in again."""
        with self._with_drives_of(vehicle) as log:
            return _appended(include_drives(log, vehicle, boot_id=boot_id, by=_by(author, reason)))

    @contextmanager
    def _with_drives_of(self, vehicle: str) -> Iterator[McapLog]:
        with self._data.new_log() as log:
            if not any(one.vehicle == vehicle for one in logged_drive_standings(log)):
                raise NoSuchName(f"vehicle {vehicle!r} has no drive in the log")
            yield log


def _by(author: str, reason: str) -> Attribution:
    return Attribution(author=author, reason=reason, stamp_ns=time.time_ns())


def _appended(report: CorrectionReport) -> Appended:
    return Appended(appended=len(report.appended), known=report.known)


def _anchor_row(label: NewLabel) -> AnchorRow:
    return AnchorRow(
        anchor=label.anchor,
        x=label.lon_deg,
        y=label.lat_deg,
        crs=WGS84,
        sigma_m=math.nan if label.sigma_m is None else label.sigma_m,
        image=label.image,
        image_sigma_m=math.nan if label.image_sigma_m is None else label.image_sigma_m,
        kind=label.kind,
        signature=label.signature,
    )


def _require_taken(found: LabelledAnchors) -> None:
    """Raises InputError for an anchor that was refused."""
    for one in found.refused:
        raise InputError(f"{one.reason}: {one.detail}")


def _label_row(one: AnchorLabelled, *, stamp_ns: int) -> LabelRow:
    return LabelRow(
        anchor=one.anchor,
        image=one.image,
        lat_deg=one.lat_deg,
        lon_deg=one.lon_deg,
        sigma_m=one.sigma_m,
        image_sigma_m=one.image_sigma_m,
        kind=one.kind,
        signature=one.signature,
        stamp_ns=stamp_ns,
    )


def _drive_row(one: DriveStanding) -> DriveRow:
    said = one.corrected
    return DriveRow(
        vehicle=one.vehicle,
        boot_id=one.boot_id,
        start_ns=one.start_ns,
        end_ns=one.end_ns,
        excluded=one.excluded,
        author=None if said is None else said.author,
        reason=None if said is None else said.reason,
    )

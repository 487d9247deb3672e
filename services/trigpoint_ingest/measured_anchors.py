"""Anchors that were measured in an image, not labelled by a person: each measurement takes the place of the last."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import logged_anchors
from trigpoint_ingest.anchors import AnchorImportReport, import_anchors
from trigpoint_ingest.core.anchors import AnchorRow, labelled
from trigpoint_ingest.corrections import Attribution, CorrectionReport, retract_anchors

MEASURED = "measured/"  # how the names of such anchors begin


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredReport:
    """What came of the new ones, and of those measured in the same image before that are not among them."""

    imported: AnchorImportReport
    retracted: CorrectionReport


def replace_measured(log: EventLog, rows: Sequence[AnchorRow], *, image: str, by: Attribution) -> MeasuredReport:
    """The anchors measured in an image are these rows from now on, their names marked as measured.

    An image measured twice is still one witness: what it said before does not hold beside what it says now. Labels of
    people, and what was measured in other images, stay. Raises AppendFailed if the log cannot be written.
    """
    marked = [replace(row, anchor=f"{MEASURED}{row.anchor}", image=image) for row in rows]
    imported = import_anchors(labelled(marked), log, stamp_ns=by.stamp_ns)
    kept = {row.anchor for row in marked}
    old = [one for one in logged_anchors(log) if one.image == image and one.anchor.startswith(MEASURED)]
    gone = [(one.anchor, one.image) for one in old if one.anchor not in kept]
    return MeasuredReport(imported=imported, retracted=retract_anchors(log, gone, by=by))

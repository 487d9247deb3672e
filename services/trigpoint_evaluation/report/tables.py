"""The report's tables: rows of text, ready for the page."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from trigpoint.geodesy.projection import MapFrame
from trigpoint_evaluation.app import TruthEvaluation
from trigpoint_evaluation.core.consistency import nis_summary
from trigpoint_evaluation.core.path_truth import PathTruthEvaluation
from trigpoint_evaluation.core.summary import ErrorSummary
from trigpoint_evaluation.report.content import AnchorPicture, DrivePicture, ReportContent, refusal_counts

DETAIL_LIMIT = 140  # characters of a refusal's detail


@dataclass(frozen=True, slots=True)
class Table:
    """A table: a line below it, column heads, rows of text; numbers are set flush right from column `numeric` on.

    One with a `fold` stands folded away behind these words.
    """

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric: int = 1
    fold: str = ""


def number(value: float, digits: int = 2) -> str:
    """A number as people read it, a dash where there is none."""
    return "–" if not math.isfinite(value) else f"{value:,.{digits}f}".replace(",", "\u202f").replace("-", "\u2212")


def vehicle_table(drives: Sequence[DrivePicture]) -> Table:
    """What each drive brought and what its gate made of it."""
    rows = []
    for drive in drives:
        summary = nis_summary(drive.judged)
        rows.append(
            (
                drive.vehicle,
                number(drive.length_m / 1000.0),
                number(drive.duration_s / 60.0, 1),
                number(len(drive.fix_m), 0),
                number(summary.accepted, 0),
                number(summary.judged - summary.accepted, 0),
                number(summary.mean),
                f"{number(summary.mean_low)} – {number(summary.mean_high)}",
            )
        )
    head = ("vehicle", "path, km", "time, min", "fixes", "accepted", "rejected", "mean NIS", "its 95 % bounds")
    caption = (
        "Mean NIS is over accepted fixes; its bounds are those of χ² with 2 degrees of freedom cut off at the gate."
    )
    return Table(caption, head, tuple(rows))


def calibration_table(drives: Sequence[DrivePicture]) -> Table:
    """The calibration states each drive was solved with."""
    solved = [drive.solved for drive in drives if drive.solved is not None]
    states = list(dict.fromkeys(name for one in solved for name, _, _ in one.calibration))
    known = [{name: _with_sigma(value, sigma) for name, value, sigma in one.calibration} for one in solved]
    rows = tuple((state, *(values.get(state, "–") for values in known)) for state in states)
    caption = "Unit: as the name ends; scales without. After ± 1-sigma, where it was computed."
    return Table(caption, ("calibration", *(one.vehicle for one in solved)), rows)


def _with_sigma(value: float, sigma: float) -> str:
    return number(value, 4) + (f" ± {number(sigma, 4)}" if math.isfinite(sigma) else "")


def image_table(content: ReportContent) -> Table:
    """Each image's own offset."""
    rows = []
    for one in content.evaluated.solved.images:
        sigma = np.sqrt(np.maximum(np.diag(one.covariance_m2), 0.0))
        labels = sum(anchor.image == one.image for anchor in content.anchors)
        east_m, north_m = (float(value) for value in one.offset_m)
        row = (
            one.image,
            f"{labels}",
            number(east_m),
            number(north_m),
            number(float(sigma[0])),
            number(float(sigma[1])),
        )
        rows.append(row)
    caption = (
        "Offset: label minus true position. The offset that all images share cannot be observed from anchors: it moves "
        "the whole map, so each 1-sigma contains it."
    )
    head = ("image", "labels", "east, m", "north, m", "1-sigma east, m", "1-sigma north, m")
    return Table(caption, head, tuple(rows))


def untied_table(anchors: Sequence[AnchorPicture]) -> Table:
    """The anchors that found no landmark, and why."""
    rows = tuple(
        (one.anchor.anchor, one.anchor.image or "survey", one.reason) for one in anchors if one.landmark_m is None
    )
    return Table("Anchors that were left out of the solve.", ("anchor", "image", "reason"), rows, 3)


def refusal_table(content: ReportContent) -> Table:
    """What ingest refused, and why."""
    rows = tuple(
        (source, reason, number(count, 0), detail[:DETAIL_LIMIT])
        for source, reason, count, detail in refusal_counts(content.refusals)
    )
    caption = "Refused messages are kept in the log's stream `refused`, whole."
    return Table(caption, ("source", "reason", "messages", "the first one"), rows, 4)


def error_row(name: str, error: ErrorSummary) -> tuple[str, ...]:
    """One line of an error table."""
    values = (error.mean, error.median, error.rmse, error.p95, error.max)
    return (name, number(error.count, 0), *(number(value) for value in values))


ERROR_HEAD = ("error, m", "count", "mean", "median", "RMSE", "95 %", "max")


def truth_table(truth: TruthEvaluation) -> Table:
    """The errors against truth."""
    landmarks = truth.landmarks
    rows = []
    if landmarks.error_m.count:
        rows.append(error_row("landmarks", landmarks.error_m))
        rows.append(error_row("landmarks, common shift removed", landmarks.error_without_shift_m))
    for one in truth.vehicles:
        rows += _path_rows(one)
    caption = "Nothing is aligned before the error is taken."
    if landmarks.error_m.count:
        matches = landmarks.matches
        caption += (
            f" {len(matches.estimated)} landmarks matched within {matches.limit_m:g} m, {matches.duplicates} doubled, "
            f"{matches.unmatched} near none, {matches.missed} true ones not in the map. "
            f"{landmarks.coverage_95:.0%} of the matched lie inside their 95 % ellipse; NEES per degree of freedom "
            f"{number(landmarks.nees_per_dof)} each by each, {number(landmarks.joint_nees_per_dof)} jointly."
        )
    return Table(caption, ERROR_HEAD, tuple(rows))


def _path_rows(one: PathTruthEvaluation) -> list[tuple[str, ...]]:
    rows = [error_row(f"{one.vehicle}, path", one.error_m)]
    if one.raw_fix_error_m.count:
        rows.append(error_row(f"{one.vehicle}, path at fixes", one.error_at_fixes_m))
        rows.append(error_row(f"{one.vehicle}, raw GNSS", one.raw_fix_error_m))
    return rows


def frame_table(frame: MapFrame) -> Table:
    """The map's reference frame."""
    accuracy = f"{frame.operation_accuracy_m:g} m" if frame.operation_accuracy_m >= 0.0 else "not stated"
    rows = (
        ("CRS", frame.crs),
        ("origin, easting", f"{number(frame.origin_easting_m, 1)} m"),
        ("origin, northing", f"{number(frame.origin_northing_m, 1)} m"),
        ("scale of the grid there", f"{(frame.point_scale - 1.0) * 1e6:+.1f} ppm"),
        ("convergence there", f"{math.degrees(frame.convergence_rad):+.4f}°"),
        ("operation from WGS 84", f"{frame.operation}; accuracy {accuracy}"),
    )
    return Table("Positions are grid metres east and north of the origin.", ("frame", ""), rows, 2)


def settings_table(content: ReportContent) -> Table:
    """What the map was solved with."""
    head = content.evaluated.solved.head
    rows = [("method", head.method), ("solved in", f"{number(head.wall_s, 1)} s")]
    rows += _flattened(json.loads(head.settings_json or "{}"))
    rows += [(f"log stream {stream}", f"{count} events") for stream, count in head.inputs]
    return Table(
        "The map can be solved again from these log positions and settings.",
        ("setting", ""),
        tuple(rows),
        2,
        "Settings and log positions",
    )


def _flattened(settings: object, prefix: str = "") -> list[tuple[str, str]]:
    if not isinstance(settings, dict):
        return [(prefix, str(settings))]
    rows = []
    for name, value in settings.items():
        rows += _flattened(value, f"{prefix}.{name}" if prefix else str(name))
    return rows


def version_table(content: ReportContent) -> Table:
    """The software."""
    return Table("", ("software", "version"), content.versions, 2, "Versions of the software")


def dates_of(drives: Sequence[DrivePicture]) -> str:
    """The day or days the drives are of, UTC."""
    stamps = [
        int(stamp) for drive in drives for stamp in drive.judged.stamp_ns[[0, -1] if len(drive.judged.nis) else []]
    ]
    if not stamps:
        return ""
    days = [datetime.fromtimestamp(stamp * 1e-9, tz=UTC).strftime("%-d %B %Y") for stamp in (min(stamps), max(stamps))]
    return days[0] if days[0] == days[1] else f"{days[0]} – {days[1]}"

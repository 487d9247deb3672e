"""The report as one HTML page without anything from outside it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup
from numpy.typing import NDArray

from trigpoint_evaluation.core.summary import summary_of
from trigpoint_evaluation.report import tables
from trigpoint_evaluation.report.chart_figures import leave_out_svg, nis_svg, residuals_svg
from trigpoint_evaluation.report.content import (
    AnchorPicture,
    DrivePicture,
    ReportContent,
    anchor_pictures,
    drive_pictures,
)
from trigpoint_evaluation.report.map_figure import Extent, MapPicture, extent_around, map_svg
from trigpoint_evaluation.report.tables import Table, number

Floats = NDArray[np.float64]
Progress = Callable[[int, int], None]

ZOOM_MARGIN_M = 20.0
RESIDUAL_FACTOR = 20.0  # residuals are decimetres in a picture of hundreds of metres
FEW_ANCHORS = 3  # fewer do not make a picture of their own


@dataclass(frozen=True, slots=True)
class Tile:
    """One number at the top of the page."""

    value: str
    unit: str
    label: str


@dataclass(frozen=True, slots=True)
class Section:
    """A heading, what it means, pictures with their captions, and tables."""

    title: str
    text: str
    figures: tuple[tuple[Markup, str], ...] = ()
    tables: tuple[Table, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Drawn:
    content: ReportContent
    drives: tuple[DrivePicture, ...]
    anchors: tuple[AnchorPicture, ...]
    picture: MapPicture


def quiet(done: int, total: int) -> None:
    """Hears of progress, and does nothing."""


def report_page(content: ReportContent, *, progress: Progress = quiet) -> str:
    """The page, the same text for the same content."""
    drives, anchors = drive_pictures(content), anchor_pictures(content)
    landmarks = content.evaluated.solved.landmarks
    picture = MapPicture(
        drives=drives,
        landmark_m=np.array([one.position_m for one in landmarks]).reshape(-1, 2),
        covariance_m2=np.array([one.covariance_m2 for one in landmarks]).reshape(-1, 2, 2),
        anchors=anchors,
    )
    drawn = _Drawn(content=content, drives=drives, anchors=anchors, picture=picture)
    sections = []
    for done, section in enumerate(SECTIONS, start=1):
        sections.append(section(drawn))
        progress(done, len(SECTIONS))
    loader = PackageLoader("trigpoint_evaluation.report", package_path="")
    autoescape = select_autoescape(["html", "j2"], default=True)
    environment = Environment(loader=loader, autoescape=autoescape, undefined=StrictUndefined, trim_blocks=True)
    return environment.get_template("page.html.j2").render(
        title=f"Landmark map, version {content.evaluated.solved.head.map_version}",
        subtitle=_subtitle(drawn),
        tiles=_tiles(drawn),
        sections=[section for section in sections if section is not None],
    )


def _subtitle(drawn: _Drawn) -> str:
    evaluated = drawn.content.evaluated
    count = len(drawn.drives)
    parts = [f"{evaluated.solved.head.method} to {evaluated.frame.crs}", f"{count} drive{'s' if count > 1 else ''}"]
    return " · ".join(part for part in (*parts, tables.dates_of(drawn.drives)) if part)


def _tiles(drawn: _Drawn) -> list[Tile]:
    content, solved = drawn.content, drawn.content.evaluated.solved
    tiles = [
        Tile(number(len(solved.landmarks), 0), "", "landmarks"),
        Tile(number(sum(drive.length_m for drive in drawn.drives) / 1000.0, 1), "km", "driven"),
    ]
    if drawn.anchors:
        tied = sum(one.landmark_m is not None for one in drawn.anchors)
        tiles.append(Tile(f"{tied} / {len(drawn.anchors)}", "", "anchors tied"))
    if content.truth is not None and content.truth.landmarks.error_m.count:
        tiles.append(Tile(number(content.truth.landmarks.error_m.mean), "m", "mean landmark error against truth"))
    if content.curves is not None and content.curves.everywhere:
        best = content.curves.everywhere[-1]
        tiles.append(Tile(number(best.error_m.mean), "m", f"held-out label, {best.tied} of {best.count} tied"))
    if content.truth is None or not content.truth.landmarks.error_m.count:
        sigma = [float(np.sqrt(np.linalg.eigvalsh(one.covariance_m2)[-1])) for one in solved.landmarks]
        tiles.append(Tile(number(float(np.median(sigma)) if sigma else float("nan")), "m", "median landmark 1-sigma"))
    return tiles


def _map_section(drawn: _Drawn) -> Section:
    paths = [drive.solved.pose[:, :2] for drive in drawn.drives if drive.solved is not None]
    labels = [one.label_m[np.newaxis] for one in drawn.anchors]
    extent = extent_around([*paths, drawn.picture.landmark_m, *labels])
    outside = np.vstack([np.zeros((0, 2)), *(drive.fix_m for drive in drawn.drives)])
    outside = outside[~extent.holds(outside)]
    caption = "Paths, landmarks and anchors in the map frame; both axes to the same scale."
    if len(outside):
        middle = np.array([0.5 * (extent.x_min_m + extent.x_max_m), 0.5 * (extent.y_min_m + extent.y_max_m)])
        far_m = float(np.linalg.norm(outside - middle, axis=1).max())
        caption += f" {len(outside)} fixes lie outside the picture, up to {number(far_m, 0)} m from its middle."
    figure = Markup(map_svg("map", drawn.picture, extent))
    return Section("The map", "", ((figure, caption),))


def _zoom_section(drawn: _Drawn) -> Section | None:
    image, extent = _zoom_extent(drawn)
    if extent is None:
        return None
    figure = Markup(map_svg("zoom", drawn.picture, extent, residual_factor=RESIDUAL_FACTOR))
    text = f"The landmarks around the anchors of {image}, where most were labelled."
    caption = "Lines from an anchor show what is left between label and map once its image's offset is taken out."
    return Section("Around the anchors", text, ((figure, caption),))


def _zoom_extent(drawn: _Drawn) -> tuple[str, Extent | None]:
    counts: dict[str, list[Floats]] = {}
    for one in drawn.anchors:
        counts.setdefault(one.anchor.image, []).append(one.label_m[np.newaxis])
    if not counts:
        return "", None
    image = max(sorted(counts), key=lambda name: len(counts[name]))
    if len(counts[image]) < FEW_ANCHORS:
        return image, None
    return image or "the survey", extent_around(counts[image], margin_m=ZOOM_MARGIN_M)


def _residual_section(drawn: _Drawn) -> Section | None:
    after = [one.residual_m for one in drawn.anchors if one.residual_m is not None]
    untied = drawn.content.untied
    if not after or untied is None or not np.isfinite(untied.residual_m).any():
        return None
    before_m = untied.residual_m
    after_m = np.array(after)
    before, left = (summary_of(np.hypot(one[:, 0], one[:, 1])) for one in (before_m, after_m))
    text = (
        f"Before anchors are tied the labels lie {number(before.mean)} m from the map on average; after, "
        f"{number(left.mean)} m, each image's own offset taken out."
    )
    figure = Markup(residuals_svg("residuals", before_m, after_m))
    rows = (tables.error_row("before: loose", before), tables.error_row("after: anchored", left))
    caption = "What is left after tying is not an error of the map: held-out anchors, above, measure that."
    return Section("Residuals before and after", text, ((figure, caption),), (Table("", tables.ERROR_HEAD, rows),))


def _leave_out_section(drawn: _Drawn) -> Section | None:
    curves = drawn.content.curves
    if curves is None or not curves.everywhere:
        return None
    last = curves.everywhere[-1]
    figure = Markup(leave_out_svg("leave-out", curves))
    text = (
        "Some labels are tied, the others are predicted and measured: label minus landmark minus the offset of its "
        f"image as the tied labels tell it. With {last.tied} of {last.count} tied the others are off by "
        f"{number(last.error_m.mean)} m on average, label noise included."
    )
    caption = (
        f"{max(one.draws for one in curves.everywhere)} draws for every number of tied labels. The paper's figures "
        "(Yi, Worrall and Nebot) are of its own campus and images, for comparison only."
    )
    return Section("Held-out anchors", text, ((figure, caption),))


def _image_section(drawn: _Drawn) -> Section | None:
    if not drawn.content.evaluated.solved.images and all(one.landmark_m is not None for one in drawn.anchors):
        return None
    shown = [tables.image_table(drawn.content), tables.untied_table(drawn.anchors)]
    return Section("Images and anchors", "", (), tuple(one for one in shown if one.rows))


def _truth_section(drawn: _Drawn) -> Section | None:
    truth = drawn.content.truth
    if truth is None:
        return None
    gate, text = truth.gate, ""
    if gate.car_park_fixes:
        share = "–" if not gate.good_after else f"{gate.good_rejected_share:.1%}"
        text = (
            f"Of {gate.car_park_fixes} fixes from inside a car park {gate.car_park_accepted} were accepted; of the "
            f"good fixes after re-acquisition {share} were rejected."
        )
    return Section("Against truth", text, (), (tables.truth_table(truth),))


def _gate_section(drawn: _Drawn) -> Section:
    known = [drive for drive in drawn.drives if np.isfinite(drive.judged.nis).any()]
    figures = tuple(
        (Markup(nis_svg(f"nis-{index}", drive.judged)), f"{drive.vehicle}, drive {drive.boot_id}.")
        for index, drive in enumerate(known)
    )
    text = (
        "NIS is a fix's squared distance from the filter's prediction in units of its own uncertainty. The gate lets "
        "95 % of sound fixes through; a mean above its bounds means the filter is too sure of itself, below, not sure "
        "enough."
    )
    return Section("The filter's gate", text, figures, (tables.vehicle_table(drawn.drives),))


def _provenance_section(drawn: _Drawn) -> Section:
    content = drawn.content
    shown = (
        tables.refusal_table(content),
        tables.calibration_table(drawn.drives),
        tables.frame_table(content.evaluated.frame),
        tables.settings_table(content),
        tables.version_table(content),
    )
    refused = "" if content.refusals else "Ingest refused nothing."
    return Section("How it came about", refused, (), tuple(table for table in shown if table.rows))


SECTIONS: tuple[Callable[[_Drawn], Section | None], ...] = (
    _map_section,
    _zoom_section,
    _truth_section,
    _leave_out_section,
    _residual_section,
    _image_section,
    _gate_section,
    _provenance_section,
)

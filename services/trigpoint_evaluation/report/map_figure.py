"""The map as a picture: raw fixes, filtered and solved paths, landmarks with their ellipses, anchors."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from trigpoint.geodesy.uncertainty import ellipses_of
from trigpoint_evaluation.core.landmark_truth import CHI2_95_2DOF
from trigpoint_evaluation.report.content import AnchorPicture, DrivePicture
from trigpoint_evaluation.report.style import (
    ANCHOR,
    FILTERED,
    LANDMARK,
    PAPER,
    RAW,
    REJECTED,
    SOLVED,
    drawn_svg,
)

Floats = NDArray[np.float64]

WIDTH_IN = 7.6
PLOT_SHARE = 0.92  # of the width: the rest is the axis and its label
HEIGHT_IN = (3.2, 7.6)
MARGIN_SHARE = 0.05
VISIBLE_SHARE = 0.0045  # of the picture's width: what a typical ellipse's semi-axis is brought to
MAGNIFICATIONS = (1, 2, 5, 10, 20, 50, 100, 200, 500)


@dataclass(frozen=True, slots=True)
class Extent:
    """A box in the map frame, in m."""

    x_min_m: float
    y_min_m: float
    x_max_m: float
    y_max_m: float

    @property
    def width_m(self) -> float:
        """East to west."""
        return self.x_max_m - self.x_min_m

    @property
    def height_m(self) -> float:
        """North to south."""
        return self.y_max_m - self.y_min_m

    def holds(self, point_m: Floats) -> NDArray[np.bool_]:
        """Which points (n, 2) lie inside, (n,)."""
        x_m, y_m = point_m[:, 0], point_m[:, 1]
        inside: NDArray[np.bool_] = (
            (x_m >= self.x_min_m) & (x_m <= self.x_max_m) & (y_m >= self.y_min_m) & (y_m <= self.y_max_m)
        )
        return inside


@dataclass(frozen=True, slots=True, kw_only=True)
class MapPicture:
    """What a map picture shows; landmarks as positions (n, 2) in m and covariances (n, 2, 2) in m^2."""

    drives: tuple[DrivePicture, ...]
    landmark_m: Floats
    covariance_m2: Floats
    anchors: tuple[AnchorPicture, ...]


def extent_around(points_m: Sequence[Floats], *, margin_m: float = 5.0) -> Extent:
    """The box around all points with a margin; a box of 100 m where there is none."""
    point_m = np.vstack([np.zeros((0, 2)), *points_m])
    if len(point_m) == 0:
        return Extent(-50.0, -50.0, 50.0, 50.0)
    low, high = point_m.min(axis=0), point_m.max(axis=0)
    margin = max(margin_m, MARGIN_SHARE * float((high - low).max()))
    return Extent(*(float(value) for value in (*(low - margin), *(high + margin))))


def magnification(covariance_m2: Floats, extent: Extent) -> int:
    """How many times ellipses are drawn too large, so that a typical one is seen."""
    if len(covariance_m2) == 0:
        return 1
    semi_m = np.sqrt(CHI2_95_2DOF) * float(np.median(ellipses_of(covariance_m2)[:, 0]))
    wanted = VISIBLE_SHARE * extent.width_m / max(semi_m, 1e-6)
    return min(MAGNIFICATIONS, key=lambda factor: abs(np.log(factor / max(wanted, 1.0))))


def picture_size(extent: Extent) -> tuple[float, float]:
    """Width and height in inches that go with equal axes."""
    height = PLOT_SHARE * WIDTH_IN * extent.height_m / max(extent.width_m, 1.0) + 0.55
    return WIDTH_IN, float(np.clip(height, *HEIGHT_IN))


def map_svg(name: str, picture: MapPicture, extent: Extent, *, residual_factor: float = 0.0) -> str:
    """The picture; with `residual_factor` above 0, residuals of tied anchors as lines that many times too long."""
    factor = magnification(picture.covariance_m2, extent)

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        _draw_drives(axes, picture.drives)
        _draw_landmarks(axes, picture, factor)
        _draw_anchors(axes, picture.anchors, residual_factor)
        axes.set_aspect("equal")
        axes.set_xlim(extent.x_min_m, extent.x_max_m)
        axes.set_ylim(extent.y_min_m, extent.y_max_m)
        axes.set_xlabel("east of the map's origin (m)")
        axes.set_ylabel("north of the map's origin (m)")
        handles = _legend(picture, factor, residual_factor)
        figure.legend(handles=handles, loc="outside upper left", ncols=3, handlelength=1.6, columnspacing=1.6)

    return drawn_svg(name, picture_size(extent), draw)


def _draw_drives(axes: Axes, drives: Sequence[DrivePicture]) -> None:
    for drive in drives:
        kept, refused = drive.fix_m[drive.accepted], drive.fix_m[~drive.accepted]
        axes.plot(kept[:, 0], kept[:, 1], ".", color=RAW, markersize=2.4, zorder=1, alpha=0.8)
        axes.plot(refused[:, 0], refused[:, 1], "x", color=REJECTED, markersize=3.6, markeredgewidth=0.9, zorder=2)
        axes.plot(drive.filtered_m[:, 0], drive.filtered_m[:, 1], "-", color=FILTERED, linewidth=0.9, zorder=3)
        if drive.solved is not None:
            path_m = drive.solved.pose[:, :2]
            axes.plot(path_m[:, 0], path_m[:, 1], "-", color=SOLVED, linewidth=1.3, zorder=4)


def _draw_landmarks(axes: Axes, picture: MapPicture, factor: int) -> None:
    if len(picture.landmark_m) == 0:
        return
    ellipse = ellipses_of(picture.covariance_m2)
    size_m = 2.0 * factor * np.sqrt(CHI2_95_2DOF) * ellipse[:, :2]
    axes.add_collection(
        EllipseCollection(
            widths=size_m[:, 0],
            heights=size_m[:, 1],
            angles=np.degrees(ellipse[:, 2]),
            units="xy",
            offsets=picture.landmark_m,
            offset_transform=axes.transData,
            facecolors=LANDMARK,
            edgecolors=LANDMARK,
            linewidths=0.5,
            alpha=0.25,
            zorder=5,
        )
    )
    axes.plot(picture.landmark_m[:, 0], picture.landmark_m[:, 1], ".", color=LANDMARK, markersize=2.6, zorder=6)


def _draw_anchors(axes: Axes, anchors: Sequence[AnchorPicture], residual_factor: float) -> None:
    for tied, marker in ((True, "s"), (False, "X")):
        point_m = np.array([one.label_m for one in anchors if (one.landmark_m is not None) is tied]).reshape(-1, 2)
        fill = "none" if tied else ANCHOR
        axes.plot(
            point_m[:, 0],
            point_m[:, 1],
            marker,
            markersize=5.2,
            markerfacecolor=fill,
            markeredgecolor=ANCHOR,
            markeredgewidth=1.1,
            linestyle="none",
            zorder=7,
        )
    if residual_factor > 0.0:
        lines = [
            np.array([one.label_m, one.label_m + residual_factor * one.residual_m])
            for one in anchors
            if one.residual_m is not None
        ]
        axes.add_collection(LineCollection(lines, colors=ANCHOR, linewidths=1.2, zorder=8))


def _legend(picture: MapPicture, factor: int, residual_factor: float) -> list[Line2D]:
    def point(marker: str, colour: str, label: str, size: float, fill: str = "") -> Line2D:
        face = fill or colour
        return Line2D(
            [], [], linestyle="none", marker=marker, color=colour, markerfacecolor=face, markersize=size, label=label
        )

    drawn = f", drawn {factor}× too large" if factor > 1 else ""
    handles = [
        point(".", RAW, "GNSS fix, accepted", 5),
        point("x", REJECTED, "GNSS fix, rejected", 5),
        Line2D([], [], color=FILTERED, linewidth=1.2, label="path, filtered"),
        Line2D([], [], color=SOLVED, linewidth=1.6, label="path, optimised"),
        point("o", LANDMARK, f"landmark, 95 % ellipse{drawn}", 5),
    ]
    if picture.anchors:
        handles.append(point("s", ANCHOR, "anchor", 5, PAPER))
    if any(one.landmark_m is None for one in picture.anchors):
        handles.append(point("X", ANCHOR, "anchor, not tied", 5))
    if residual_factor > 0.0:
        label = f"residual left, {residual_factor:g}× too long"
        handles.append(Line2D([], [], color=ANCHOR, linewidth=1.2, label=label))
    return handles

"""The charts: NIS over time, residuals before and after, and what anchors not tied would have cost."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from trigpoint_evaluation.core.consistency import JudgedFixes, cut_off_moments
from trigpoint_evaluation.core.draws import LeaveOutResult
from trigpoint_evaluation.report.content import LeaveOutCurves
from trigpoint_evaluation.report.style import ANCHOR, FAINT, FILTERED, INK, RAW, REJECTED, SOLVED, drawn_svg

Floats = NDArray[np.float64]

WIDE_IN, SQUARE_IN = (7.6, 2.5), (7.6, 3.3)
NIS_FLOOR = 1e-2  # what a logarithmic axis begins at
WINDOW = 60  # fixes in the running mean of NIS
PAPER_UNTIED_M = 1.8  # Yi, Worrall and Nebot: mean error of 50 poles before any is tied
PAPER_PLATEAU_M = (0.57, 0.75)  # and the plateau they reach over several images


def nis_svg(name: str, judged: JudgedFixes) -> str:
    """NIS of one drive's fixes against the gate, and its running mean against the bounds it should keep."""

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        known = np.isfinite(judged.nis)
        minute = (judged.stamp_ns - judged.stamp_ns[0]) * 1e-9 / 60.0
        nis = np.maximum(judged.nis, NIS_FLOOR)
        kept, refused = known & judged.accepted, known & ~judged.accepted
        axes.plot(minute[kept], nis[kept], ".", color=RAW, markersize=2.6, label="accepted")
        axes.plot(
            minute[refused], nis[refused], "x", color=REJECTED, markersize=3.8, markeredgewidth=0.9, label="rejected"
        )
        _draw_gate(axes, judged, minute, known)
        axes.set_yscale("log")
        axes.minorticks_off()
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _power_of_ten(value)))
        axes.set_xlabel("time since the first fix (min)")
        axes.set_ylabel("NIS (2 degrees of freedom)")
        axes.set_xlim(0.0, float(minute[-1]) if len(minute) else 1.0)
        figure.legend(loc="outside upper left", ncols=5, handlelength=1.4, columnspacing=1.4)

    return drawn_svg(name, WIDE_IN, draw)


def _power_of_ten(value: float) -> str:
    """0.01 to 1000 in full, beyond as 10⁴."""
    exponent = round(math.log10(value))
    superscript = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    return f"{value:g}" if -3 < exponent < 4 else "10" + f"{exponent}".translate(superscript)


def _draw_gate(axes: Axes, judged: JudgedFixes, minute: Floats, known: NDArray[np.bool_]) -> None:
    limit = float(np.median(judged.limit[known]))
    axes.axhline(limit, color=INK, linewidth=1.0, linestyle=(0, (4, 3)), label=f"gate, {limit:.2f}")
    inside = known & judged.accepted & (judged.nis <= judged.limit)
    if np.count_nonzero(inside) < 2 * WINDOW:
        return
    mean, deviation = cut_off_moments(limit)
    reach = 1.96 * deviation / np.sqrt(WINDOW)
    axes.axhspan(mean - reach, mean + reach, color=SOLVED, alpha=0.16, linewidth=0, label="95 % bounds of the mean")
    running = np.convolve(judged.nis[inside], np.full(WINDOW, 1.0 / WINDOW), mode="valid")
    middle = minute[inside][WINDOW // 2 : WINDOW // 2 + len(running)]
    axes.plot(middle, running, color=SOLVED, linewidth=1.4, label=f"mean of {WINDOW} accepted")


def residuals_svg(name: str, before_m: Floats, after_m: Floats) -> str:
    """Label minus map (n, 2) in m, before anchors were tied and after: as a cloud, and how many are within how much."""

    def draw(figure: Figure) -> None:
        cloud, share = figure.subplots(1, 2, width_ratios=[1.0, 1.25])
        sets = (("before: loose", before_m, FILTERED, "o"), ("after: anchored", after_m, SOLVED, "s"))
        for label, residual_m, colour, marker in sets:
            cloud.plot(
                residual_m[:, 0],
                residual_m[:, 1],
                marker,
                color=colour,
                markersize=3.2,
                linestyle="none",
                alpha=0.85,
                label=label,
            )
            away_m = np.sort(np.hypot(residual_m[:, 0], residual_m[:, 1]))
            if len(away_m):
                percent = 100.0 * np.arange(1, len(away_m) + 1) / len(away_m)
                share.step(np.append(0.0, away_m), np.append(0.0, percent), where="post", color=colour, linewidth=1.6)
        cloud.axhline(0.0, color=FAINT, linewidth=0.7)
        cloud.axvline(0.0, color=FAINT, linewidth=0.7)
        cloud.set_aspect("equal", adjustable="datalim")
        cloud.set_xlabel("label minus map, east (m)")
        cloud.set_ylabel("north (m)")
        share.set_xlabel("distance of label and map (m)")
        share.set_ylabel("labels within it (%)")
        share.set_ylim(0.0, 102.0)
        share.set_xlim(left=0.0)
        figure.legend(*cloud.get_legend_handles_labels(), loc="outside upper left", ncols=2)

    return drawn_svg(name, SQUARE_IN, draw)


def leave_out_svg(name: str, curves: LeaveOutCurves) -> str:
    """Mean error of the labels not tied over how many are tied, with the draws' band and the paper's figures."""

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        last = max([one.tied for one in curves.everywhere], default=1)
        plateau = "the paper's plateau, 0.57–0.75 m"
        axes.fill_between([0, last], *PAPER_PLATEAU_M, color=ANCHOR, alpha=0.15, linewidth=0, label=plateau)
        axes.plot([0], [PAPER_UNTIED_M], "D", color=ANCHOR, markersize=5, clip_on=False, zorder=6)
        axes.annotate(
            "the paper, none tied: 1.8 m", (0, PAPER_UNTIED_M), (8, 0), textcoords="offset points", va="center"
        )
        _draw_curve(axes, curves.everywhere, SOLVED, "all labels, held out at random", band=True)
        _draw_curve(axes, curves.blocked, FILTERED, "held out in blocks", band=False)
        _draw_curve(axes, curves.within_image, INK, f"labels of {curves.image} alone", band=False)
        axes.set_xlabel("labels tied")
        axes.set_ylabel("error of the others (m)")
        axes.set_xlim(-0.4, last + 0.4)
        axes.set_ylim(bottom=0.0)
        figure.legend(loc="outside upper left", ncols=3, handlelength=1.8)

    return drawn_svg(name, SQUARE_IN, draw)


def _draw_curve(axes: Axes, results: Sequence[LeaveOutResult], colour: str, label: str, *, band: bool) -> None:
    known = [one for one in results if one.error_m.count]
    if not known:
        return
    tied = [one.tied for one in known]
    if band:
        low, high = zip(*(one.band_m for one in known), strict=True)
        axes.fill_between(tied, low, high, color=colour, alpha=0.16, linewidth=0, label="90 % of the draws")
    axes.plot(tied, [one.error_m.mean for one in known], "-", color=colour, linewidth=1.7, label=f"mean, {label}")

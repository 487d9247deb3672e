"""How pictures look: drawn in placeholder colours that the page's style sheet gives their meaning, light or dark."""

import io
from collections.abc import Callable
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

# Placeholder colour: the style sheet's variable. Dark and light pages give the variables different values.
INK, FAINT, RULE, PAPER = "#010101", "#010102", "#010103", "#010104"
RAW, FILTERED, SOLVED, REJECTED, LANDMARK, ANCHOR = "#010105", "#010106", "#010107", "#010108", "#010109", "#01010a"
VARIABLES = {
    INK: "--ink",
    FAINT: "--faint",
    RULE: "--rule",
    PAPER: "--paper",
    RAW: "--raw",
    FILTERED: "--filtered",
    SOLVED: "--solved",
    REJECTED: "--rejected",
    LANDMARK: "--landmark",
    ANCHOR: "--anchor",
}

RC = {
    "svg.fonttype": "none",
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.labelcolor": FAINT,
    "axes.edgecolor": RULE,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.facecolor": "none",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": RULE,
    "grid.linewidth": 0.5,
    "grid.alpha": 0.7,
    "text.color": INK,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.major.size": 0.0,
    "ytick.major.size": 0.0,
    "figure.facecolor": "none",
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
}


def drawn_svg(name: str, size_in: tuple[float, float], draw: Callable[[Figure], None]) -> str:
    """An SVG element, drawn by `draw` on a figure of this size in inches, with the page's colours.

    `name` keeps the identifiers in it apart from those of other pictures on the page. The same input gives the
    same text.
    """
    settings: Any = {**RC, "svg.hashsalt": name}
    with rc_context(settings):
        figure = Figure(figsize=size_in, layout="constrained")
        FigureCanvasSVG(figure)
        draw(figure)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None}, transparent=True)
    return _themed(buffer.getvalue(), name)


def _themed(document: str, name: str) -> str:
    element = document[document.index("<svg") :]
    for colour, variable in VARIABLES.items():
        element = element.replace(colour, f"var({variable})")
    element = element.replace("'DejaVu Sans'", "var(--sans)")
    for before in ('id="', 'href="#', "url(#"):
        element = element.replace(before, f"{before}{name}-")
    return element

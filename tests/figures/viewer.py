"""The viewer in Chromium: how soon there is a picture, and how soon a label's map is seen."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from statistics import median

from figures.figure import Bounds, Figure, Measurement, at_most
from figures.workbench import CommandFailed, Workbench
from viewed_maps.browser import chromium, missing, viewed
from viewed_maps.labelling import beside_a_suggestion, placed_by_keyboard, retracted, submitted
from viewed_maps.solving import solving

COMMAND = "viewed_maps: trigpoint up on the small campus, its viewer in Chromium (software rendering, 1280 x 800)"
LOADS = 5


@dataclass(frozen=True, slots=True)
class Looked:
    """The median of loads with empty caches; what a label and its retraction took; how many complaints there were."""

    first_picture_ms: float
    label_s: float
    retraction_s: float
    complaints: float


@cache
def looked(folder: Path) -> Looked:
    """The viewer used once."""
    if missing():
        raise CommandFailed(missing())
    (folder / "viewer").mkdir(parents=True, exist_ok=True)
    complaints: list[str] = []
    loads_ms: list[float] = []
    with solving(folder / "viewer") as served, chromium() as browser:
        for _ in range(LOADS):
            with viewed(browser) as page:
                loads_ms.append(page.open(served.url))
                complaints += page.complaints
        with viewed(browser, reduced_motion="reduce") as page:
            page.open(served.url, token=served.token)
            beside_a_suggestion(page)
            name = placed_by_keyboard(page)
            label_s, retraction_s = submitted(page, name), retracted(page, name)
            complaints += page.complaints
    return Looked(median(loads_ms), label_s, retraction_s, float(len(complaints)))


def _looked(bench: Workbench, *, value: Callable[[Looked], float]) -> Measurement:
    try:
        return Measurement(value=value(looked(bench.folder)), command=COMMAND)
    except AssertionError as error:
        raise CommandFailed(f"{COMMAND}: {error}") from error


def _figure(name: str, unit: str, target: Bounds | None, value: Callable[[Looked], float]) -> Figure:
    return Figure(name=name, unit=unit, target=target, measure=partial(_looked, value=value))


FIGURES = (
    _figure("first picture", "ms", at_most(2000.0), lambda seen: seen.first_picture_ms),
    _figure("a label until its map version is seen", "s", None, lambda seen: seen.label_s),
    _figure("a retraction until its map version is seen", "s", None, lambda seen: seen.retraction_s),
    _figure("errors and warnings of the console", "1", at_most(0.0), lambda seen: seen.complaints),
)

"""The viewer in Chromium: how soon there is a picture, and how soon a label's map is seen."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from statistics import median

from figures.figure import Bounds, Figure, Measurement, at_most
from figures.workbench import CommandFailed, Workbench
from map_http.served import geopackage_line, served_map
from viewed_maps.browser import chromium, missing, viewed
from viewed_maps.labelling import beside_a_suggestion, placed_by_keyboard, retracted, submitted
from viewed_maps.solving import solved_campus, solving

COMMAND = "viewed_maps: trigpoint serve http, then up, on the small campus; its viewer in Chromium (drawn by software)"
LOADS = 5


@dataclass(frozen=True, slots=True)
class Looked:
    """The median of loads with empty caches; what a label and its retraction took; how many complaints there were."""

    first_picture_ms: float
    label_s: float
    retraction_s: float
    complaints: float


@dataclass(frozen=True, slots=True)
class Load:
    """How long the first picture took, and what the console was told."""

    first_picture_ms: float
    complaints: list[str]


@cache
def looked(folder: Path) -> Looked:
    """The viewer used once."""
    if missing():
        raise CommandFailed(missing())
    folder = folder / "viewer"
    data = solved_campus(folder)
    loads = list(_loads(folder, data))
    with solving(folder) as served, chromium() as browser, viewed(browser, reduced_motion="reduce") as page:
        page.open(served.url, token=served.token)
        beside_a_suggestion(page)
        name = placed_by_keyboard(page)
        label_s, retraction_s = submitted(page, name), retracted(page, name)
        complaints = [*page.complaints, *(one for load in loads for one in load.complaints)]
    return Looked(median(load.first_picture_ms for load in loads), label_s, retraction_s, float(len(complaints)))


def _loads(folder: Path, data: Path) -> Iterator[Load]:
    """The page opened again and again, with nothing else at work."""
    database = geopackage_line(data / "landmarks.gpkg")
    with served_map(folder, database=database, data=data) as served, chromium() as browser:
        for _ in range(LOADS):
            with viewed(browser) as page:
                yield Load(page.open(served.url), page.complaints)


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

"""A map whose landmarks have the most awkward names a log may hold."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path

from landmark_maps.examples import checkpoint, landmark
from map_features.examples import two_versions
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.model import Landmark, MapChange

ODD_TEXTS = (
    '=HYPERLINK("http://example.com")',
    "+1",
    "-1",
    "@SUM(A1)",
    "'quoted",
    'a "quote", a comma',
    "two\nlines",
    "\ttab",
    "<b>&amp;</b>]]>",
    "Übergröße 標石 🜨",
    " spaces ",
    "NULL",
    "007",
    "-1e5",
)


def odd_landmarks() -> list[Landmark]:
    """A landmark of each odd text, which is its name and its signature."""
    return [
        landmark(text, 10.0 * number, -5.0)._replace(signature=text, kind="pole")
        for number, text in enumerate(ODD_TEXTS)
    ]


def map_changes() -> tuple[MapChange, MapChange]:
    """Two versions of 300 landmarks, of which the second moves a hundred by 10 m, and the odd ones."""
    first, second = two_versions()
    return replace(first, opened=(*first.opened, *odd_landmarks())), second


def fill(folder: Path) -> Path:
    """A data directory with that map, and no log."""
    folder.mkdir(parents=True, exist_ok=True)
    with closing(GeoPackageStore(folder / "landmarks.gpkg")) as store:
        for number, one in enumerate(map_changes()):
            store.apply(one, checkpoint(number + 1))
    return folder


def newest() -> dict[str, Landmark]:
    """The landmarks of the second version by name."""
    first, second = map_changes()
    return {row.landmark: row for row in (*first.opened, *second.opened)}

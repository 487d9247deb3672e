"""Pages of features and vector tiles from a landmark database in a GeoPackage: found by its index, sifted in Python."""

import asyncio
import sqlite3
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar, cast

from shapely.geometry import box
from sqlalchemy import Connection

from trigpoint.errors import DatabaseUnavailable
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.landmarks.condition_truth import meets
from trigpoint.landmarks.feature_query import FeaturePage, FeatureQuery, GridBox, MapState, VersionSummary
from trigpoint.landmarks.feature_rendering import LayerRow, MapFeature, features_json, map_feature, row_of_record
from trigpoint.landmarks.geopackage_feature_sql import page_statement, tile_statement
from trigpoint.landmarks.geopackage_file import close, database_errors, driver_of, opened
from trigpoint.landmarks.geopackage_geometry import decoded, decoded_point
from trigpoint.landmarks.landmark_record import LandmarkRecord, landmark_of
from trigpoint.landmarks.layers import LANDMARKS, Layer
from trigpoint.landmarks.model import LabelGain
from trigpoint.landmarks.python_tiles import drawn_lines, drawn_points
from trigpoint.landmarks.queries import DegreeBox, TimeSpan
from trigpoint.landmarks.version_sql import GAINS, HISTORY, SETTINGS, gain_of, summary_of

Answer = TypeVar("Answer")

EXTENT = """SELECT min(lon_deg), min(lat_deg), max(lon_deg), max(lat_deg), min(first_seen_ns), max(last_seen_ns)
FROM landmarks"""
FRAME = """SELECT crs, origin_easting_m, origin_northing_m, solved_ns FROM map_versions
ORDER BY map_version DESC LIMIT 1"""


class GeoPackageFeatures:
    """A FeatureSource in the file at `path`, asked in a thread of its own; a file that is not there yet is away."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="geopackage")
        self._connection: tuple[int, Connection] | None = None

    async def state(self, known: MapState | None) -> MapState | None:
        """The map as it is now."""
        return await self._asked(lambda driver: _state(driver, known))

    async def page(self, query: FeatureQuery, state: MapState) -> FeaturePage:
        """The features that meet a query."""
        return await self._asked(lambda driver: _page(driver, query, state))

    async def tile(self, layer: Layer, tile: WebTile, state: MapState, *, as_of: int) -> bytes:
        """The vector tile of a layer, empty if nothing is in it."""
        return await self._asked(lambda driver: _tile(driver, layer, tile, state, as_of))

    async def history(self, limit: int) -> tuple[VersionSummary, ...]:
        """The newest versions in order."""
        rows = await self._asked(lambda driver: driver.execute(HISTORY, {"limit": limit}).fetchall())
        return tuple(summary_of(row) for row in reversed(rows))

    async def settings_json(self, as_of: int) -> str:
        """The settings a version was solved with."""
        ((settings_json,),) = await self._asked(lambda driver: driver.execute(SETTINGS, {"as_of": as_of}).fetchall())
        return str(settings_json)

    async def label_gains(self, as_of: int) -> tuple[LabelGain, ...]:
        """What one more label would tell."""
        rows = await self._asked(lambda driver: driver.execute(GAINS, {"as_of": as_of}).fetchall())
        return tuple(map(gain_of, rows))

    async def close(self) -> None:
        """The file closed."""
        await asyncio.get_running_loop().run_in_executor(self._thread, self._disconnect)
        self._thread.shutdown()

    async def _asked(self, question: Callable[[sqlite3.Connection], Answer]) -> Answer:
        return await asyncio.get_running_loop().run_in_executor(self._thread, self._answer, question)

    def _answer(self, question: Callable[[sqlite3.Connection], Answer]) -> Answer:
        with database_errors(self._path):
            return question(driver_of(self._connected()))

    def _connected(self) -> Connection:
        """The connection to the file that has the name now: one that was deleted and made again is another one."""
        try:
            number = self._path.stat().st_ino
        except OSError as error:
            raise DatabaseUnavailable(f"no landmark database at {self._path} yet") from error
        if self._connection is None or self._connection[0] != number:
            self._disconnect()
            self._connection = (number, opened(self._path, read_only=True))
        return self._connection[1]

    def _disconnect(self) -> None:
        if self._connection is not None:
            close(self._connection[1])
            self._connection = None


def _state(driver: sqlite3.Connection, known: MapState | None) -> MapState | None:
    driver.execute("BEGIN")
    try:
        versions = tuple(row[0] for row in driver.execute("SELECT map_version FROM map_versions ORDER BY map_version"))
        if not versions or (known is not None and known.versions == versions):
            return known if versions else None
        crs, easting_m, northing_m, solved_ns = driver.execute(FRAME).fetchone()
        west, south, east, north, first_ns, last_ns = driver.execute(EXTENT).fetchone()
    finally:
        driver.execute("COMMIT")
    held = west is not None
    return MapState(
        versions=versions,
        crs=crs,
        origin_easting_m=easting_m,
        origin_northing_m=northing_m,
        solved_ns=solved_ns,
        box=DegreeBox(lon_min_deg=west, lat_min_deg=south, lon_max_deg=east, lat_max_deg=north) if held else None,
        seen=TimeSpan(first_ns=first_ns, last_ns=last_ns) if held else None,
    )


def _page(driver: sqlite3.Connection, query: FeatureQuery, state: MapState) -> FeaturePage:
    as_of = state.newest if query.as_of is None else query.as_of
    statement, values = page_statement(query, state, as_of=as_of)
    met = (one for one in _found(driver.execute(statement, values), query.layer, state.crs) if _meets(one, query))
    features = list(islice(met, query.limit + 1))
    shown = features[: query.limit]
    return FeaturePage(
        map_version=as_of,
        features=features_json(shown, query.crs),
        count=len(shown),
        next_id=features[query.limit].feature_id if len(features) > query.limit else None,
    )


def _found(rows: sqlite3.Cursor, layer: Layer, map_crs: str) -> Iterator[MapFeature]:
    names = [column[0] for column in rows.description]
    for row in rows:
        yield map_feature(_row(row, layer, names), map_crs)


def _row(row: tuple[Any, ...], layer: Layer, names: list[str]) -> LayerRow:
    if layer is LANDMARKS:
        easting_m, northing_m = decoded_point(row[0])
        return landmark_of(cast(LandmarkRecord, row), easting_m=easting_m, northing_m=northing_m)
    record = dict(zip(names, row, strict=True))
    if record.get("geom") is not None:
        record["geom"] = (0, decoded(record["geom"]))
    return row_of_record(layer, record)


def _meets(feature: MapFeature, query: FeatureQuery) -> bool:
    """Whether a feature meets the areas and the filter; the rest the database has looked at."""
    if query.areas and not any(_is_in(feature, area) for area in query.areas):
        return False
    return meets(query.condition, feature.value, feature.shape)


def _is_in(feature: MapFeature, area: DegreeBox | GridBox) -> bool:
    if isinstance(area, GridBox):
        shape = feature.grid_shape()
        bounds = (area.easting_min_m, area.northing_min_m, area.easting_max_m, area.northing_max_m)
    else:
        if feature.lon_lat_deg is not None:
            return area.contains(feature.lon_lat_deg[1], feature.lon_lat_deg[0])
        shape = feature.shape()
        bounds = (area.lon_min_deg, area.lat_min_deg, area.lon_max_deg, area.lat_max_deg)
    return shape is not None and bool(shape.intersects(box(*bounds)))


def _tile(driver: sqlite3.Connection, layer: Layer, tile: WebTile, state: MapState, as_of: int) -> bytes:
    statement, values = tile_statement(layer, tile, state, as_of=as_of)
    rows = driver.execute(statement, values).fetchall()
    if layer.geometry == "Point":
        return drawn_points(layer, tile, rows)
    return drawn_lines(layer, tile, [(decoded(row[0]), row[1:]) for row in rows], state.crs)

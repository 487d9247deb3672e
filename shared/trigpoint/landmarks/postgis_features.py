"""Pages of features and vector tiles from a PostGIS database, for many askers at once."""

import asyncio
import re
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import psycopg
from psycopg.rows import dict_row
from sqlalchemy import URL

from trigpoint.errors import DatabaseUnavailable, InputError, ServiceError
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.landmarks.feature_query import FeaturePage, FeatureQuery, MapState, VersionSummary
from trigpoint.landmarks.feature_rendering import LayerRow, features_json, map_feature, row_of_record
from trigpoint.landmarks.layers import LANDMARKS, Layer
from trigpoint.landmarks.model import LabelGain
from trigpoint.landmarks.postgis_feature_sql import landmark_page_statement, row_page_statement
from trigpoint.landmarks.postgis_geometry import decoded
from trigpoint.landmarks.postgis_session import AWAY, SESSION, server_url
from trigpoint.landmarks.postgis_tiles import tile_statement
from trigpoint.landmarks.queries import DegreeBox, TimeSpan
from trigpoint.landmarks.version_sql import GAINS, HISTORY, SETTINGS, gain_of, summary_of

STATEMENT_LIMIT_MS = 10_000  # a question that takes longer is given up
READING = (
    f"{SESSION['options']} -c default_transaction_read_only=on -c statement_timeout={STATEMENT_LIMIT_MS} -c jit=off"
)
NEWEST = "SELECT max(map_version) FROM map_versions"
FRAME = """SELECT crs, origin_easting_m, origin_northing_m, solved_ns FROM map_versions
ORDER BY map_version DESC LIMIT 1"""
EXTENT = """SELECT min(lon_deg), min(lat_deg), max(lon_deg), max(lat_deg), min(first_seen_ns), max(last_seen_ns)
FROM landmarks"""

Connection = psycopg.AsyncConnection[Any]


class PostgisFeatures:
    """A FeatureSource on a server; `url` as for PostgisStore. Of one event loop; at most `connections` at once.

    Raises InputError for a URL or a password file that cannot be read.
    """

    def __init__(self, url: str, *, password_file: Path | None = None, connections: int = 4) -> None:
        parsed = server_url(url, password_file)
        self._shown = parsed.render_as_string(hide_password=True)
        self._options = _options(parsed)
        self._room = asyncio.Semaphore(connections)
        self._idle: list[Connection] = []
        self._closed = False

    async def state(self, known: MapState | None) -> MapState | None:
        """The map as it is now; what does not change with every look is asked for anew only with a new version."""
        async with self._connection() as connection:
            ((newest,),) = await _rows(connection, NEWEST)
            if newest is None:
                return None
            if known is not None and known.newest == newest:
                return known
            async with connection.transaction():
                await connection.execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ")
                return await _state(connection)

    async def page(self, query: FeatureQuery, state: MapState) -> FeaturePage:
        """The features that meet a query."""
        if query.layer is LANDMARKS:
            return await self._landmark_page(query, state)
        as_of = state.newest if query.as_of is None else query.as_of
        statement, values = row_page_statement(replace(query, as_of=as_of), state)
        async with self._connection() as connection:
            found = await connection.cursor(row_factory=dict_row).execute(statement, values)
            rows = [_row(record, query.layer) for record in await found.fetchall()]
        features = [map_feature(row, state.crs) for row in rows]
        shown = features[: query.limit]
        return FeaturePage(
            map_version=as_of,
            features=features_json(shown, query.crs),
            count=len(shown),
            next_id=features[query.limit].feature_id if len(features) > query.limit else None,
        )

    async def tile(self, layer: Layer, tile: WebTile, state: MapState, *, as_of: int) -> bytes:
        """The vector tile of a layer, empty if nothing is in it."""
        statement, values = tile_statement(layer, tile, state, as_of=as_of)
        async with self._connection() as connection:
            ((content,),) = await _rows(connection, statement, values)
        return bytes(content or b"")

    async def history(self, limit: int) -> tuple[VersionSummary, ...]:
        """The newest versions in order."""
        rows = await self._named_rows(HISTORY, {"limit": limit})
        return tuple(summary_of(row) for row in reversed(rows))

    async def settings_json(self, as_of: int) -> str:
        """The settings a version was solved with."""
        ((settings_json,),) = await self._named_rows(SETTINGS, {"as_of": as_of})
        return str(settings_json)

    async def label_gains(self, as_of: int) -> tuple[LabelGain, ...]:
        """What one more label would tell."""
        return tuple(map(gain_of, await self._named_rows(GAINS, {"as_of": as_of})))

    async def close(self) -> None:
        """Every connection ended."""
        self._closed = True
        for connection in self._idle:
            await connection.close()
        self._idle.clear()

    async def _named_rows(self, statement: str, values: Mapping[str, int]) -> list[Any]:
        """The rows of a statement whose values are named `:name`."""
        async with self._connection() as connection:
            return await _rows(connection, re.sub(r":(\w+)", r"%(\1)s", statement), values)

    async def _landmark_page(self, query: FeatureQuery, state: MapState) -> FeaturePage:
        statement, values = landmark_page_statement(query, state)
        async with self._connection() as connection:
            ((map_version, count, text, last_id),) = await _rows(connection, statement, values)
        features = text.encode()
        if count > query.limit:  # the last one is the next page's first; no JSON text holds bare quotes like these
            features = features[: features.rindex(b',{"type":"Feature",')]
        return FeaturePage(
            map_version=map_version or 0,
            features=features,
            count=min(count, query.limit),
            next_id=last_id if count > query.limit else None,
        )

    @asynccontextmanager
    async def _connection(self) -> AsyncIterator[Connection]:
        """A connection for one question; one that fails in it is not used again."""
        async with self._room:
            connection: Connection | None = None
            try:
                connection = self._idle.pop() if self._idle else await self._connected()
                yield connection
            except psycopg.Error as error:
                raise self._named(error) from error
            finally:
                if connection is not None:
                    await self._put_back(connection)

    async def _connected(self) -> Connection:
        if self._closed:
            raise DatabaseUnavailable(f"landmark database {self._shown}: it was closed")
        connection: Connection = await psycopg.AsyncConnection.connect(**self._options, autocommit=True)
        connection.prepare_threshold = 1
        return connection

    async def _put_back(self, connection: Connection) -> None:
        idle = connection.pgconn.transaction_status == psycopg.pq.TransactionStatus.IDLE
        if self._closed or not idle or connection.broken:
            await connection.close()
        else:
            self._idle.append(connection)

    def _named(self, error: psycopg.Error) -> Exception:
        line = f"landmark database {self._shown}: {' '.join(str(error).split())}"
        if isinstance(error, AWAY):
            self._idle.clear()  # whatever ended this one has ended the others
            return DatabaseUnavailable(line)
        return InputError(line) if isinstance(error, psycopg.DataError) else ServiceError(line)


def _options(url: URL) -> dict[str, Any]:
    given = {"host": url.host, "port": url.port, "user": url.username, "password": url.password}
    named = {name: value for name, value in given.items() if value is not None}
    return {**SESSION, **named, **url.query, "dbname": url.database, "options": READING}


async def _rows(connection: Connection, statement: str, values: Mapping[str, object] | None = None) -> list[Any]:
    found = await connection.execute(statement, values, prepare=True)
    return await found.fetchall()


async def _state(connection: Connection) -> MapState:
    """The map as one transaction sees it; there is a version."""
    versions = await _rows(connection, "SELECT map_version FROM map_versions ORDER BY map_version")
    ((crs, easting_m, northing_m, solved_ns),) = await _rows(connection, FRAME)
    ((west, south, east, north, first_ns, last_ns),) = await _rows(connection, EXTENT)
    held = west is not None
    return MapState(
        versions=tuple(number for (number,) in versions),
        crs=crs,
        origin_easting_m=easting_m,
        origin_northing_m=northing_m,
        solved_ns=solved_ns,
        box=DegreeBox(lon_min_deg=west, lat_min_deg=south, lon_max_deg=east, lat_max_deg=north) if held else None,
        seen=TimeSpan(first_ns=first_ns, last_ns=last_ns) if held else None,
    )


def _row(record: dict[str, Any], layer: Layer) -> LayerRow:
    geometry = record.get("geom")
    if geometry is not None:
        record["geom"] = decoded(bytes.fromhex(geometry))
    return row_of_record(layer, record)

"""Pages of features and single ones, as GeoJSON with the links that lead on."""

import asyncio
import json
from collections.abc import Callable, Sequence
from http import HTTPStatus
from urllib.parse import quote

from starlette.responses import Response

from trigpoint.landmarks.feature_crs import CRS84, FeatureCrs
from trigpoint.landmarks.feature_query import FeaturePage, FeatureQuery, FeatureSource, MapState
from trigpoint.landmarks.layers import Layer
from trigpoint_landmarks.http.asked import Asked
from trigpoint_landmarks.http.compression import VARY
from trigpoint_landmarks.http.documents import GEOJSON, JSON, JsonObject, link
from trigpoint_landmarks.http.drive_pages import drive_page
from trigpoint_landmarks.http.map_watch import MapWatch
from trigpoint_landmarks.http.page_parameters import item_query, page_query
from trigpoint_landmarks.http.ports import DriveRow
from trigpoint_landmarks.http.problems import Problem

EMPTY = FeaturePage(map_version=0, features=b"", count=0, next_id=None)
Drives = Callable[[], Sequence[DriveRow]]


class Pages:
    """Answers from a source, of the version a watch knows; `drives` blocks, and is asked in a thread."""

    def __init__(self, source: FeatureSource, watch: MapWatch, drives: Drives | None) -> None:
        self._source, self._watch, self._drives = source, watch, drives

    async def items(self, asked: Asked, layer: Layer) -> Response:
        """A page of a layer's features. Raises InputError, Problem, DatabaseUnavailable."""
        state = await self._watch.current()
        if state is None:
            return _geojson(_collection(asked, layer, EMPTY, CRS84), CRS84)
        as_of = asked.whole("as_of")
        state = await self._watch.version(as_of, state)
        query = page_query(asked, layer, state, as_of=as_of)
        page = await self._page(query, state)
        return _geojson(_collection(asked, layer, page, query.crs), query.crs)

    async def item(self, asked: Asked, layer: Layer, feature_id: str) -> Response:
        """One feature. Raises as `items`, and Problem where there is none of this id."""
        state = await self._watch.current()
        missing = Problem(HTTPStatus.NOT_FOUND, f"no feature {feature_id[:100]!r} in {layer.name}")
        if state is None:
            raise missing
        as_of = asked.whole("as_of")
        state = await self._watch.version(as_of, state)
        query = item_query(asked, layer, state, feature_id, as_of=as_of)
        page = await self._page(query, state)
        if not page.count:
            raise missing
        own = f"/collections/{layer.name}"
        links = [
            link(asked.url(), "self", GEOJSON),
            link(asked.url(own), "collection", JSON, layer.title),
            link(asked.url(f"{own}/items/{quote(feature_id, safe='')}"), "canonical", GEOJSON),
        ]
        head = json.dumps({"map_version": page.map_version, "links": links})[:-1]
        return _geojson(b"".join((head.encode(), b",", page.features[1:])), query.crs)

    async def _page(self, query: FeatureQuery, state: MapState) -> FeaturePage:
        as_of = state.newest if query.as_of is None else query.as_of
        if query.layer.stored:
            return await self._source.page(query, state)
        assert self._drives is not None
        drives = await asyncio.to_thread(self._drives)
        return drive_page(drives, query, map_version=as_of)


def _collection(asked: Asked, layer: Layer, page: FeaturePage, crs: FeatureCrs) -> bytes:
    """The page as a FeatureCollection; how many there are in all is said where that is known."""
    head: JsonObject = {"type": "FeatureCollection", "map_version": page.map_version, "numberReturned": page.count}
    if page.next_id is None and "from" not in asked.parameters:
        head["numberMatched"] = page.count
    head["links"] = _page_links(asked, layer, page)
    return b"".join((json.dumps(head)[:-1].encode(), b', "features": [', page.features, b"]}"))


def _page_links(asked: Asked, layer: Layer, page: FeaturePage) -> list[JsonObject]:
    links = [
        link(asked.url(), "self", GEOJSON),
        link(asked.url(f="json"), "alternate", GEOJSON),
        link(asked.url(f"/collections/{layer.name}"), "collection", JSON),
    ]
    if page.next_id is not None:  # of the same version, whatever is solved while somebody reads on
        changed = {"from": page.next_id, "as_of": page.map_version}
        links.append(link(asked.url(**changed), "next", GEOJSON))
    return links


def _geojson(content: bytes, crs: FeatureCrs) -> Response:
    headers = {"Content-Crs": f"<{crs.uri}>", "Cache-Control": "no-cache", "Vary": VARY}
    return Response(content, HTTPStatus.OK, headers, GEOJSON)

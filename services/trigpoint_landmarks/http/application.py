"""The HTTP service as one ASGI application: admission first, the two busiest paths next, the framework for the rest."""

import html
import json
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import Request
from starlette.responses import Response

from trigpoint.errors import TrigpointError
from trigpoint.landmarks.feature_query import FeatureSource
from trigpoint.landmarks.layers import LAYERS, Layer
from trigpoint.observability.metrics import Instruments
from trigpoint_landmarks.http import documents
from trigpoint_landmarks.http.admission import Admission
from trigpoint_landmarks.http.anchor_advice import AnchorAdvice
from trigpoint_landmarks.http.asked import Asked, asked_of
from trigpoint_landmarks.http.compression import accepts_gzip
from trigpoint_landmarks.http.documents import JSON, OPENAPI_JSON, QUADS, SCHEMA_JSON, JsonObject
from trigpoint_landmarks.http.driven import LoggedDrives
from trigpoint_landmarks.http.event_stream import PATH as EVENTS_PATH
from trigpoint_landmarks.http.event_stream import VersionFeed
from trigpoint_landmarks.http.front import Beside, Front
from trigpoint_landmarks.http.labelling import labelling_router
from trigpoint_landmarks.http.map_facts import FactsOfMap
from trigpoint_landmarks.http.map_watch import MapWatch
from trigpoint_landmarks.http.measures import RequestMeasures
from trigpoint_landmarks.http.openapi import api_document
from trigpoint_landmarks.http.pages import Pages
from trigpoint_landmarks.http.ports import MapCorrections, MeasuredDrives
from trigpoint_landmarks.http.problems import Problem, problem_of, problem_response
from trigpoint_landmarks.http.rasters import Rasters
from trigpoint_landmarks.http.settings import MEBIBYTE, WebSettings
from trigpoint_landmarks.http.shifts import Shifts
from trigpoint_landmarks.http.tiles import Held, Tiles, asked_version, tile_of, tiled_layer
from trigpoint_landmarks.http.viewer_api import ViewerApi
from trigpoint_landmarks.http.viewer_files import PREFIX as VIEWER_PREFIX

VIEWER_FILES = f"{VIEWER_PREFIX}{{file:path}}"

Handler = Callable[[Request], Awaitable[Response]]


@dataclass(frozen=True, slots=True)
class MapApi:
    """The handlers of everything that is read."""

    settings: WebSettings
    watch: MapWatch
    pages: Pages
    tiles: Tiles
    facts: FactsOfMap
    layers: tuple[Layer, ...]
    written: JsonObject

    def asked(self, request: Request) -> Asked:
        """What a request asks."""
        return asked_of(request.scope, public_url=self.settings.public_url)

    def layer(self, name: str) -> Layer:
        """The layer of a name. Raises Problem where there is none."""
        found = LAYERS.get(name)
        if found not in self.layers:
            there = ", ".join(one.name for one in self.layers)
            raise Problem(HTTPStatus.NOT_FOUND, f"no collection {name[:40]!r}: there are {there}")
        return found

    async def landing(self, request: Request) -> Response:
        """The landing page, for programs or for people."""
        asked = self.asked(request)
        asked.require_only(("f",))
        page = documents.landing_page(asked)
        form = asked.parameters.get("f") or ("html" if "text/html" in request.headers.get("accept", "") else "json")
        if form == "html":
            return Response(_html(page), 200, {"Content-Security-Policy": "default-src 'none'"}, "text/html")
        return _json(asked, page)

    async def conformance(self, request: Request) -> Response:
        """What the API conforms to."""
        return _json(self.asked(request), documents.conformance())

    async def versions(self, request: Request) -> Response:
        """Every map version."""
        asked = self.asked(request)
        state = await self.watch.current()
        history = () if state is None else await self.facts.history(state)
        return _json(asked, documents.versions_document(asked, state, history))

    async def api(self, request: Request) -> Response:
        """The API's definition."""
        asked = self.asked(request)
        content = api_document(self.written, self.layers, base_url=asked.base_url)
        return _json(asked, content, OPENAPI_JSON)

    async def collections(self, request: Request) -> Response:
        """All collections."""
        asked = self.asked(request)
        return _json(asked, documents.collection_list(asked, self.layers, await self.watch.current()))

    async def collection(self, request: Request) -> Response:
        """One collection."""
        asked, layer = self.asked(request), self.layer(request.path_params["name"])
        return _json(asked, documents.collection(asked, layer, await self.watch.current()))

    async def queryables(self, request: Request) -> Response:
        """What conditions can be put on."""
        asked, layer = self.asked(request), self.layer(request.path_params["name"])
        return _json(asked, documents.queryables(asked, layer), SCHEMA_JSON)

    async def items(self, request: Request) -> Response:
        """A page of features."""
        return await self.pages.items(self.asked(request), self.layer(request.path_params["name"]))

    async def item(self, request: Request) -> Response:
        """One feature."""
        layer = self.layer(request.path_params["name"])
        return await self.pages.item(self.asked(request), layer, request.path_params["feature_id"])

    async def tilesets(self, request: Request) -> Response:
        """The tile sets of a collection."""
        asked = self.asked(request)
        return _json(asked, documents.tileset_list(asked, tiled_layer(request.path_params["name"])))

    async def tileset(self, request: Request) -> Response:
        """The tile set of a collection."""
        asked, layer = self.asked(request), tiled_layer(request.path_params["name"])
        return _json(asked, documents.tileset(asked, layer, await self.watch.current()))

    async def tilejson(self, request: Request) -> Response:
        """TileJSON."""
        asked, layer = self.asked(request), tiled_layer(request.path_params["name"])
        as_of, state = asked_version(asked), await self.watch.current()
        if as_of is not None and state is not None:
            state = await self.watch.version(as_of, state)
        content = documents.tilejson(asked, layer, state, as_of=as_of)
        return Response(_encoded(content), 200, {"Cache-Control": "no-cache"}, JSON)

    async def matrix_sets(self, request: Request) -> Response:
        """The tile matrix sets."""
        asked = self.asked(request)
        return _json(asked, documents.tile_matrix_set_list(asked))

    async def matrix_set(self, request: Request) -> Response:
        """WebMercatorQuad."""
        return _json(self.asked(request), documents.tile_matrix_set())

    async def ogc_tile(self, request: Request) -> Response:
        """A tile, its row before its column."""
        path = request.path_params
        return await self.tile(request, path["name"], (path["zoom"], path["column"], path["row"]))

    async def plain_tile(self, request: Request) -> Response:
        """A tile as most programs ask for it, in a path that may name a version."""
        path = request.path_params
        return await self.tile(request, path["name"], (path["zoom"], path["column"], path["row"]), path.get("version"))

    async def tile(
        self, request: Request, name: str, place: tuple[str, str, str], version: str | None = None
    ) -> Response:
        """The tile of a layer. Raises Problem where there is none."""
        zoom, column, row = place
        layer, tile = tiled_layer(name), tile_of(zoom, column, row.removesuffix(".mvt").removesuffix(".pbf"))
        as_of = asked_version(self.asked(request))
        if version is not None:
            if not version.isascii() or not version.isdigit() or len(version) > 18 or as_of is not None:
                raise Problem(HTTPStatus.NOT_FOUND, f"no map version {version[:40]!r}")
            as_of = int(version)
        held = Held(
            etag=request.headers.get("if-none-match", ""),
            in_gzip=accepts_gzip(request.headers.get("accept-encoding", "")),
        )
        return await self.tiles.tile(self.asked(request), layer, tile, as_of=as_of, held=held)

    def routes(self) -> dict[str, Handler]:
        """Every path that is read, and its handler."""
        own = "/collections/{name}"
        place = "{name}/{zoom}/{column}/{row}"
        return {
            "/": self.landing,
            "/conformance": self.conformance,
            "/versions": self.versions,
            "/api": self.api,
            "/collections": self.collections,
            own: self.collection,
            f"{own}/queryables": self.queryables,
            f"{own}/items": self.items,
            f"{own}/items/{{feature_id:path}}": self.item,
            f"{own}/tiles": self.tilesets,
            f"{own}/tiles/{QUADS}": self.tileset,
            f"{own}/tiles/{QUADS}/{{zoom}}/{{row}}/{{column}}": self.ogc_tile,
            "/tiles/{name}.json": self.tilejson,
            f"/tiles/{place}": self.plain_tile,
            f"/v/{{version}}/tiles/{place}": self.plain_tile,
            "/tileMatrixSets": self.matrix_sets,
            f"/tileMatrixSets/{QUADS}": self.matrix_set,
        }


def _json(asked: Asked, content: JsonObject, kind: str = JSON) -> Response:
    """A document, which has one form. Raises InputError where another one is asked for."""
    asked.require_only(("f",))
    if asked.parameters.get("f", "json") != "json":
        raise Problem(HTTPStatus.BAD_REQUEST, f"f {asked.parameters['f'][:40]!r}: json is there")
    return Response(_encoded(content), 200, {"Cache-Control": "no-cache"}, kind)


def _encoded(content: JsonObject) -> bytes:
    return json.dumps(content, ensure_ascii=False).encode()


def _html(page: JsonObject) -> str:
    """The landing page's links for people."""
    lines = [
        f'<li><a href="{html.escape(one["href"])}">{html.escape(one.get("title", one["rel"]))}</a></li>'
        for one in page["links"]
    ]
    title, description = html.escape(page["title"]), html.escape(page["description"])
    head = f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>'
    return f"{head}<h1>{title}</h1><p>{description}</p><ul>{''.join(lines)}</ul></html>"


def corrections_definition() -> JsonObject:
    """What the framework says of the routes that write."""
    described = FastAPI(openapi_url=None)
    described.include_router(labelling_router(None))
    return described.openapi()


@dataclass(frozen=True, slots=True, kw_only=True)
class Served:
    """What is served: a database, what is known of it, where there is a log what it holds and takes, and where there is
    a folder of check layers, those."""

    source: FeatureSource
    watch: MapWatch
    corrections: MapCorrections | None = None
    drives: MeasuredDrives | None = None
    shifts: Path | None = None


def application(settings: WebSettings, served: Served, instruments: Instruments) -> Any:
    """The ASGI application. Raises InputError for a token file that cannot be read."""
    admission = Admission(settings)
    framework = FastAPI(openapi_url=None, docs_url=None, redoc_url=None, redirect_slashes=False)
    router = labelling_router(served.corrections)
    framework.include_router(router)
    api = _map_api(settings, served, instruments, public=admission.is_open)
    routes = {**api.routes(), **_viewer_api(settings, served, api.facts).routes()}
    for path, handler in routes.items():
        framework.add_route(path, handler, methods=["GET"], include_in_schema=False)
    for kind in (HTTPException, RequestValidationError, Problem, TrigpointError, Exception):
        framework.add_exception_handler(kind, _answer_problem)
    written = (route.path for route in router.routes if isinstance(route, APIRoute))
    beside = Beside(
        feed=VersionFeed(served.watch, instruments, limit=settings.listeners),
        measures=RequestMeasures(instruments, (*routes, *written, EVENTS_PATH, VIEWER_FILES)),
    )
    return _with_origins(Front(framework, api, admission, settings, beside=beside), settings)


def _map_api(settings: WebSettings, served: Served, instruments: Instruments, *, public: bool) -> MapApi:
    source, watch, corrections = served.source, served.watch, served.corrections
    return MapApi(
        settings=settings,
        watch=watch,
        pages=Pages(source, watch, None if corrections is None else corrections.drives),
        tiles=Tiles(
            source,
            watch,
            cache_bytes=settings.tile_cache_mib * MEBIBYTE,
            public=public,
            instruments=instruments,
        ),
        facts=FactsOfMap(source, {image: one.bounds for one in settings.rasters for image in one.images}),
        layers=tuple(layer for layer in LAYERS.values() if layer.stored or corrections is not None),
        written=corrections_definition(),
    )


def _viewer_api(settings: WebSettings, served: Served, facts: FactsOfMap) -> ViewerApi:
    drives = LoggedDrives(served.drives, served.corrections)
    return ViewerApi(
        settings=settings,
        watch=served.watch,
        advice=AnchorAdvice(facts, drives.in_force),
        drives=drives,
        rasters=Rasters({one.name: one for one in settings.rasters}),
        shifts=Shifts(served.shifts),
        can_write=served.corrections is not None,
    )


def _with_origins(front: Front, settings: WebSettings) -> Any:
    """The application, for pages of other origins too where there are any."""
    if not settings.origins:
        return front
    return CORSMiddleware(
        front,
        allow_origins=settings.origins,
        allow_methods=["GET", "HEAD", "POST", "DELETE"],
        allow_headers=["Authorization", "Content-Type", "If-None-Match"],
        expose_headers=["ETag", "Content-Crs", "Location"],
    )


async def _answer_problem(request: Request, error: Exception) -> Response:
    return problem_response(problem_of(error))

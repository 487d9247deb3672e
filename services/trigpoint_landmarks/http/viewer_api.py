"""What a viewer asks beside features and tiles: what a label would do, where the next one helps, what the log holds."""

import json
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from http import HTTPStatus

from starlette.requests import Request
from starlette.responses import Response

from trigpoint.landmarks.feature_query import MapState
from trigpoint_landmarks.http.anchor_advice import AnchorAdvice
from trigpoint_landmarks.http.asked import Asked, asked_of
from trigpoint_landmarks.http.documents import JSON, JsonObject
from trigpoint_landmarks.http.driven import LoggedDrives
from trigpoint_landmarks.http.labelling import caller_of
from trigpoint_landmarks.http.map_watch import MapWatch
from trigpoint_landmarks.http.problems import Problem
from trigpoint_landmarks.http.rasters import Rasters
from trigpoint_landmarks.http.settings import WebSettings
from trigpoint_landmarks.http.shifts import Shifts
from trigpoint_landmarks.http.tiles import tile_of
from trigpoint_landmarks.http.tokens import Scope

Handler = Callable[[Request], Awaitable[Response]]
Advice = Callable[[Asked, MapState, int], Awaitable[JsonObject]]

ACCESS_PATH = "/access"
RASTER_TILE = "/rasters/{name}/{zoom}/{column}/{row}"
ANYONE = "anyone"
NO_VERSION = "there is no map version yet"
SIGMAS = ("sigma_m", "image_sigma_m")
ASSOCIATION = ("lat_deg", "lon_deg", *SIGMAS, "image", "kind", "signature", "anchor", "as_of")
NO_ASSOCIATION: JsonObject = {
    "map_version": None,
    "landmark": "",
    "reason": NO_VERSION,
    **dict.fromkeys(("distance_m", "corrected_distance_m", "gate_m", "chi_square", "chi_square_limit")),
    **dict.fromkeys(("landmark_position", "landmark_kind", "runner_up", "expected_variance_reduction_m2")),
    "already_anchored_by": [],
    "explanation": f"The label would be tied to no landmark: {NO_VERSION}.",
}
NO_SUGGESTIONS: JsonObject = {"map_version": None, "summed_variance_m2": None, "suggestions": [], "method": NO_VERSION}


@dataclass(frozen=True, slots=True)
class ViewerApi:
    """The handlers."""

    settings: WebSettings
    watch: MapWatch
    advice: AnchorAdvice
    drives: LoggedDrives
    rasters: Rasters
    shifts: Shifts
    can_write: bool

    async def association(self, request: Request) -> Response:
        """What would become of a label."""
        return await self._of_version(request, ASSOCIATION, self.advice.association, NO_ASSOCIATION)

    async def suggestions(self, request: Request) -> Response:
        """Where one more anchor would help most."""
        return await self._of_version(request, ("limit", *SIGMAS, "as_of"), self.advice.suggestions, NO_SUGGESTIONS)

    async def images(self, request: Request) -> Response:
        """The images the map knows of."""

        async def told(asked: Asked, state: MapState, as_of: int) -> JsonObject:
            return await self.advice.images(state, as_of)

        return await self._of_version(request, ("as_of",), told, {"map_version": None, "images": []})

    async def paths(self, request: Request) -> Response:
        """Drives' paths by odometry or filter."""
        asked = self._asked(request, ("source", "drive"))
        return await self.drives.paths(asked, await self._newest())

    async def fixes(self, request: Request) -> Response:
        """Fixes with their verdicts."""
        asked = self._asked(request, ("accepted", "drive"))
        return await self.drives.fixes(asked, await self._newest())

    async def labels(self, request: Request) -> Response:
        """The labels in force."""
        self._asked(request, ())
        return _json(await self.drives.labels())

    async def raster_list(self, request: Request) -> Response:
        """The pictures there are."""
        self._asked(request, ())
        return _json(self.rasters.document())

    async def raster_tile(self, request: Request) -> Response:
        """A picture's tile."""
        self._asked(request, ())
        path = request.path_params
        row, _, ending = path["row"].rpartition(".")
        tile = tile_of(path["zoom"], path["column"], row)
        return await self.rasters.tile(path["name"], tile, ending, etag=request.headers.get("if-none-match", ""))

    async def shift_list(self, request: Request) -> Response:
        """The images whose shift against the ortho layer was measured."""
        self._asked(request, ())
        return _json(await self.shifts.document())

    async def shift_layer(self, request: Request) -> Response:
        """An image's shift, tile by tile."""
        self._asked(request, ())
        return await self.shifts.layer(request.path_params["image"], etag=request.headers.get("if-none-match", ""))

    async def access(self, request: Request) -> Response:
        """What whoever asks may do."""
        self._asked(request, ())
        caller = caller_of(request)
        with_token = "authorization" in request.headers
        can_label = caller.scope is not None and caller.scope.allows(Scope.LABEL) and self.can_write
        answer = {
            "name": caller.name if with_token else ANYONE,
            "scope": None if caller.scope is None else caller.scope.value,
            "can_read": caller.scope is not None,
            "can_label": can_label,
            "why_not_label": "" if can_label else self._why_not(),
        }
        return _json(answer)

    def _why_not(self) -> str:
        if not self.can_write:
            return "this process has no log: nothing can be written here"
        if self.settings.token_file is None:
            return "no token file is set: nothing can be written here"
        return f"a token with scope {Scope.LABEL.value!r} is needed"

    async def _of_version(
        self, request: Request, known: tuple[str, ...], answer: Advice, nothing: JsonObject
    ) -> Response:
        """An answer of the version asked for; `nothing` before the first."""
        asked = self._asked(request, known)
        state, as_of = await self.watch.current(), asked.whole("as_of")
        if state is None:
            return _json(nothing)
        state = await self.watch.version(as_of, state)
        return _json(await answer(asked, state, state.newest if as_of is None else as_of))

    async def _newest(self) -> int | None:
        state = await self.watch.current()
        return None if state is None else state.newest

    def _asked(self, request: Request, known: tuple[str, ...]) -> Asked:
        asked = asked_of(request.scope, public_url=self.settings.public_url)
        asked.require_only((*known, "f"))
        if asked.parameters.get("f", "json") != "json":
            raise Problem(HTTPStatus.BAD_REQUEST, f"f {asked.parameters['f'][:40]!r}: json is there")
        return asked

    def routes(self) -> dict[str, Handler]:
        """Every path and its handler."""
        return {
            "/association": self.association,
            "/anchor-suggestions": self.suggestions,
            "/images": self.images,
            "/paths": self.paths,
            "/fixes": self.fixes,
            "/labels": self.labels,
            "/rasters": self.raster_list,
            RASTER_TILE: self.raster_tile,
            "/shifts": self.shift_list,
            "/shifts/{image}": self.shift_layer,
            ACCESS_PATH: self.access,
        }


def _json(content: JsonObject) -> Response:
    encoded = json.dumps(content, ensure_ascii=False, allow_nan=False).encode()
    return Response(encoded, HTTPStatus.OK, {"Cache-Control": "no-cache"}, JSON)

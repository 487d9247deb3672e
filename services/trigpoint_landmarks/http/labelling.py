"""What changes the map: labels and their retraction, drives left out and let in, each as an event in the log."""

import asyncio
from collections.abc import Callable
from http import HTTPStatus
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import APIRouter, Path, Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field

from trigpoint.landmarks.layers import anchor_id
from trigpoint_landmarks.http.admission import Caller
from trigpoint_landmarks.http.ports import Appended, MapCorrections, NewLabel
from trigpoint_landmarks.http.problems import Problem

TEXT_LIMIT = 200  # characters, as the log's own limit of a text
PRINTED = r"^[^\x00-\x1f\x7f]*$"

Text = Annotated[str, Field(max_length=TEXT_LIMIT, pattern=PRINTED)]
SomeText = Annotated[str, Field(min_length=1, max_length=TEXT_LIMIT, pattern=PRINTED)]
Sigma = Annotated[float, Field(ge=1e-4, le=100.0, description="1-sigma per axis in metres")]


class LabelBody(BaseModel):
    """A position labelled in an image; an image of "" is a survey."""

    model_config = ConfigDict(extra="forbid", strict=True)

    anchor: SomeText
    image: Text = ""
    lat_deg: Annotated[float, Field(ge=-90.0, le=90.0)]
    lon_deg: Annotated[float, Field(ge=-180.0, le=180.0)]
    sigma_m: Sigma = 0.10
    image_sigma_m: Annotated[float, Field(ge=0.0, le=100.0, description="the image's own, 1-sigma per axis")] = 0.35
    kind: Text = ""
    signature: Text = ""


class DriveBody(BaseModel):
    """Which of a vehicle's drives, "" for all of them, and why."""

    model_config = ConfigDict(extra="forbid", strict=True)

    boot_id: Text = ""
    reason: Text = ""


class AppendedAnswer(BaseModel):
    """How many events are new in the log, and how many said what stood there already."""

    appended: int
    known: int


IMAGE_PARAMETER = {
    "name": "image",
    "in": "query",
    "description": "The image it was labelled in, where that is not the only one",
    "schema": {"type": "string", "maxLength": TEXT_LIMIT},
}


def labelling_router(corrections: MapCorrections | None) -> APIRouter:
    """The routes; without a log every one of them says that nothing can be written here."""
    router = APIRouter(tags=["corrections"])
    writer = _Writer(corrections)
    labelled: dict[int | str, dict[str, Any]] = {200: {"model": AppendedAnswer, "description": "It was so already"}}
    router.add_api_route("/anchors", writer.label, methods=["POST"], status_code=201, responses=labelled)
    image = {"parameters": [IMAGE_PARAMETER]}
    router.add_api_route("/anchors/{anchor:path}", writer.retract, methods=["DELETE"], openapi_extra=image)
    router.add_api_route("/drives/{vehicle}/exclude", writer.exclude, methods=["POST"])
    router.add_api_route("/drives/{vehicle}/include", writer.include, methods=["POST"])
    return router


def caller_of(request: Request) -> Caller:
    """Who asks, as admission found out."""
    caller = request.scope["state"]["caller"]
    assert isinstance(caller, Caller)
    return caller


class _Writer:
    """One correction at a time, each in a thread: appending waits for the disk."""

    def __init__(self, corrections: MapCorrections | None) -> None:
        self._corrections = corrections
        self._one_at_a_time = asyncio.Lock()

    async def label(self, body: LabelBody, response: Response) -> AppendedAnswer:
        """Label an anchor; the next map version is tied to it."""
        label = NewLabel(**body.model_dump())
        done = await self._append(lambda corrections: corrections.label(label))
        own = quote(anchor_id(label.anchor, label.image), safe="")
        response.headers["Location"] = f"/collections/anchors/items/{own}"
        if not done.appended:
            response.status_code = HTTPStatus.OK
        return done

    async def retract(
        self,
        anchor: Annotated[str, Path(max_length=TEXT_LIMIT, pattern=PRINTED)],
        request: Request,
        reason: Annotated[str, Query(max_length=TEXT_LIMIT, pattern=PRINTED)] = "",
    ) -> AppendedAnswer:
        """Take an anchor back; the next map version is as if it had never been labelled."""
        author = caller_of(request).name
        image = request.query_params.get("image")
        return await self._append(
            lambda corrections: corrections.retract(anchor, image=image, author=author, reason=reason)
        )

    async def exclude(
        self, vehicle: Annotated[str, Path(max_length=TEXT_LIMIT, pattern=PRINTED)], body: DriveBody, request: Request
    ) -> AppendedAnswer:
        """Leave drives out of the map."""
        author, boot_id = caller_of(request).name, body.boot_id or None
        return await self._append(
            lambda corrections: corrections.exclude(vehicle, boot_id=boot_id, author=author, reason=body.reason)
        )

    async def include(
        self, vehicle: Annotated[str, Path(max_length=TEXT_LIMIT, pattern=PRINTED)], body: DriveBody, request: Request
    ) -> AppendedAnswer:
        """Let drives that were left out take part again."""
        author, boot_id = caller_of(request).name, body.boot_id or None
        return await self._append(
            lambda corrections: corrections.include(vehicle, boot_id=boot_id, author=author, reason=body.reason)
        )

    async def _append(self, correct: Callable[[MapCorrections], Appended]) -> AppendedAnswer:
        corrections = self._corrections
        if corrections is None:
            raise Problem(HTTPStatus.FORBIDDEN, "nothing can be written here: this process has no log")
        async with self._one_at_a_time:
            done = await asyncio.to_thread(correct, corrections)
        return AppendedAnswer(appended=done.appended, known=done.known)

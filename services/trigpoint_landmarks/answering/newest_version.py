"""The newest map version as answers: a page is mostly a join of bytes made before."""

import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from trigpoint.bus.ports import Content
from trigpoint.errors import InputError
from trigpoint.geodesy.projection import WGS84, is_geographic, transform_coordinates
from trigpoint.landmarks.asked import GEOJSON, AnsweredMap, AnswerForm, LandmarkQuestion, Point
from trigpoint.landmarks.geojson import DEGREE_DECIMALS, METRE_DECIMALS, landmark_feature
from trigpoint.landmarks.messages import (
    entry_of,
    landmark_answer_bytes,
    landmark_bytes,
    landmark_of,
    parsed,
    placed_entry_of,
    schema_of,
)
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.paging import LandmarkPage, next_page_token, resumed
from trigpoint.landmarks.queries import LandmarkQuery, PageMark
from trigpoint.landmarks.selection import mark_of
from trigpoint_landmarks.answering.memory_index import FoundSlots, MemoryIndex
from trigpoint_schemas.v1 import asked_pb2 as pb

ANSWER_SCHEMA = schema_of(pb.LandmarksAnswered)
CRS_NAME = re.compile(r"[A-Za-z]{2,10}:[A-Za-z0-9]{1,12}")  # an authority and a code: nothing that PROJ would open


class NewestVersion:
    """A map version whose landmarks are in memory. Not for several threads at once."""

    def __init__(self) -> None:
        self._index = MemoryIndex()
        self.map = AnsweredMap()
        self._head = landmark_answer_bytes(self.map, ())

    @property
    def map_version(self) -> int:
        """The number of the version, 0 before the first."""
        return self.map.map_version

    @property
    def landmark_count(self) -> int:
        """How many landmarks it has."""
        return len(self._index)

    def change(self, to: AnsweredMap, *, changed: Iterable[Landmark], removed: Iterable[str]) -> None:
        """From now on this version, which differs from the one before by these landmarks."""
        self._index.change(changed, removed)
        self.map = to
        self._head = landmark_answer_bytes(to, ())

    def is_asked(self, question: LandmarkQuestion) -> bool:
        """Whether a question is about this version: the one it names, or that of its page, else the newest there is.

        Raises InputError for a page that is none.
        """
        query = resumed(question.query, question.page) if question.page else question.query
        return query.as_of in (None, self.map_version)

    def page(self, question: LandmarkQuestion, *, limit: int, bytes_most: int) -> Content:
        """The page a question asks for, of `limit` landmarks if it names no number, and at most so many bytes, but one
        landmark.

        Raises InputError for a page that is none, and for a CRS that is not known.
        """
        query = resumed(question.query, question.page) if question.page else question.query
        found = self._index.found(query, limit=limit)
        encoded = self._encoded(found.slots, question)
        kept = _fitting(encoded, bytes_most)
        token = self._next_page(query, found, kept)
        if question.form is AnswerForm.GEOJSON:
            return _collection(self.map, encoded[:kept], crs=question.crs, next_page=token)
        if not (question.crs or token):
            return Content(b"".join((self._head, *encoded)), ANSWER_SCHEMA)
        payload = landmark_answer_bytes(self.map, encoded[:kept], crs=question.crs, next_page=token)
        return Content(payload, ANSWER_SCHEMA)

    def _next_page(self, query: LandmarkQuery, found: FoundSlots, kept: int) -> str:
        if not kept or (kept == len(found.slots) and not found.more):
            return ""
        query = replace(query, as_of=self.map_version)
        distance_m = found.distances_m[kept - 1] if query.by_distance else None
        return next_page_token(query, PageMark(landmark=self._index.name(found.slots[kept - 1]), distance_m=distance_m))

    def _encoded(self, slots: Sequence[int], question: LandmarkQuestion) -> list[bytes]:
        if not question.crs and question.form is AnswerForm.PROTOBUF:
            return self._index.entries(slots)
        lat_deg, lon_deg = self._index.places_deg(slots)
        points = points_in(question.crs, lat_deg.tolist(), lon_deg.tolist())
        landmarks = self._index.landmarks(slots)
        if question.form is AnswerForm.PROTOBUF:
            return [placed_entry_of(one, point) for one, point in zip(landmarks, points, strict=True)]
        rows = [landmark_of(parsed(pb.AnsweredLandmark, one), self.map) for one in landmarks]
        return [feature_bytes(row, point) for row, point in zip(rows, _or_none(points, len(rows)), strict=True)]


def stored_page(of: AnsweredMap, page: LandmarkPage, question: LandmarkQuestion, *, bytes_most: int) -> Content:
    """A page of an older version from the store, of so many bytes at most, but one landmark; the question names the
    version. Raises InputError for a CRS that is not known."""
    rows = page.landmarks
    points = points_in(question.crs, [row.lat_deg for row in rows], [row.lon_deg for row in rows])
    if question.form is AnswerForm.GEOJSON:
        encoded = [feature_bytes(row, at) for row, at in zip(rows, _or_none(points, len(rows)), strict=True)]
    elif points:
        encoded = [placed_entry_of(landmark_bytes(row), at) for row, at in zip(rows, points, strict=True)]
    else:
        encoded = [entry_of(landmark_bytes(row)) for row in rows]
    kept = _fitting(encoded, bytes_most)
    token = page.next_page
    if kept < len(rows):
        token = next_page_token(question.query, mark_of(rows[kept - 1], question.query))
    if question.form is AnswerForm.GEOJSON:
        return _collection(of, encoded[:kept], crs=question.crs, next_page=token)
    return Content(landmark_answer_bytes(of, encoded[:kept], crs=question.crs, next_page=token), ANSWER_SCHEMA)


def _or_none(points: Sequence[Point], count: int) -> Sequence[Point | None]:
    """A point for each, or None for each where no CRS was asked for."""
    return points or [None] * count


def points_in(crs: str, lat_deg: Sequence[float], lon_deg: Sequence[float]) -> list[Point]:
    """Positions in a CRS, x or longitude first; none where no CRS is named.

    Raises InputError for a CRS that is not named by authority and code, FrameRefused for one that is not known.
    """
    if not crs:
        return []
    if not CRS_NAME.fullmatch(crs):
        raise InputError(f"CRS {crs[:40]!r} is not named by authority and code, like EPSG:32756")
    x, y = transform_coordinates(np.array(lon_deg), np.array(lat_deg), source_crs=WGS84, target_crs=crs)
    decimals = DEGREE_DECIMALS if is_geographic(crs) else METRE_DECIMALS
    return list(zip(np.round(x, decimals).tolist(), np.round(y, decimals).tolist(), strict=True))


def feature_bytes(landmark: Landmark, point: Point | None) -> bytes:
    """A landmark as a GeoJSON feature, at a point of the CRS asked for."""
    return json.dumps(landmark_feature(landmark, coordinates=point), ensure_ascii=False).encode()


def _fitting(encoded: Sequence[bytes], bytes_most: int) -> int:
    """How many of them fit, at least one."""
    if sum(map(len, encoded)) <= bytes_most:
        return len(encoded)
    size = 0
    for count, one in enumerate(encoded):
        size += len(one)
        if size > bytes_most:
            return max(count, 1)
    return len(encoded)


def _collection(of: AnsweredMap, features: Sequence[bytes], *, crs: str, next_page: str) -> Content:
    """A FeatureCollection; `crs` says in which the coordinates are, as RFC 7946 knows only one."""
    said = {"map_version": of.map_version, "solved_ns": of.solved_ns, "crs": crs or WGS84, "next_page": next_page}
    head = json.dumps({"type": "FeatureCollection", **said})[:-1].encode()
    return Content(b'%s, "features": [%s]}' % (head, b", ".join(features)), "", GEOJSON)

"""Answers from the store: older versions, what changed since one; and the coverage."""

from dataclasses import replace
from typing import Protocol

from trigpoint.bus.ports import Content
from trigpoint.errors import InputError
from trigpoint.landmarks.asked import (
    AnsweredMap,
    ChangeQuestion,
    CoverageAnswer,
    CoverageQuestion,
    LandmarkQuestion,
    Question,
    answered_map,
)
from trigpoint.landmarks.messages import change_answer_bytes, coverage_answer_bytes, schema_of
from trigpoint.landmarks.paging import page_of
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint_landmarks.answering.newest_version import stored_page
from trigpoint_landmarks.core.coverage import COVERAGE_ZOOM
from trigpoint_schemas.v1 import asked_pb2 as pb

CHANGES_SCHEMA, COVERAGE_SCHEMA = schema_of(pb.ChangesAnswered), schema_of(pb.CoverageAnswered)


class Coverage(Protocol):
    """Knows what was observed when."""

    def answer(self, question: CoverageQuestion) -> CoverageAnswer:
        """The passes over the tiles asked for. Raises InputError for more than it answers at once."""


class StoredAnswers:
    """Answers of one open store; not for several threads at once."""

    def __init__(self, store: LandmarkStore, coverage: Coverage, *, page_landmarks: int, bytes_most: int) -> None:
        self._store, self._coverage = store, coverage
        self._page_landmarks, self._bytes_most = page_landmarks, bytes_most
        self._maps: dict[int, AnsweredMap] = {}

    def answer(self, question: Question) -> Content:
        """The answer to a question. Raises InputError for one outside its limits, and as the store does."""
        match question:
            case LandmarkQuestion():
                return self._landmarks(question)
            case ChangeQuestion():
                content = self._changes(question)
            case CoverageQuestion():
                payload = coverage_answer_bytes(self._coverage.answer(question), zoom=COVERAGE_ZOOM)
                content = Content(payload, COVERAGE_SCHEMA)
        if len(content.payload) > self._bytes_most:
            size = f"an answer of {len(content.payload)} bytes, at most {self._bytes_most} are sent"
            raise InputError(f"{size}: ask for a smaller area")
        return content

    def _landmarks(self, question: LandmarkQuestion) -> Content:
        asked = replace(question.query, limit=question.query.limit or self._page_landmarks)
        page = page_of(self._store, asked, token=question.page)
        query = replace(asked, as_of=page.map_version)
        return stored_page(
            self._map(page.map_version), page, replace(question, query=query), bytes_most=self._bytes_most
        )

    def _changes(self, question: ChangeQuestion) -> Content:
        found = self._store.changes(question.query, since=question.since)
        of = self._map(found.as_of)
        payload = change_answer_bytes(of, since=found.since, changed=found.changed, removed=found.removed)
        return Content(payload, CHANGES_SCHEMA)

    def _map(self, map_version: int) -> AnsweredMap:
        if map_version and map_version not in self._maps:
            self._maps = {version.map_version: answered_map(version) for version in self._store.map_versions()}
        return self._maps.get(map_version, AnsweredMap())

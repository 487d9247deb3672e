"""The map asked over the bus: what any client of it embeds."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from trigpoint.bus.ports import Bus, Content
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.client.core.constellations import Constellation
from trigpoint.client.core.known_landmarks import (
    EXPECTED,
    GnssPrior,
    area_around,
    known_constellation,
    on_grid,
    position_prior,
)
from trigpoint.client.core.motion_fit import Expectation
from trigpoint.client.core.placing import Placed, VehiclePose, placed
from trigpoint.client.core.relocalisation import Relocalised, relocalised
from trigpoint.errors import InputError, MapUnanswered
from trigpoint.events.keys import ASK_PATTERN, DEFAULT_MAP, DEFAULT_ROOT, map_key
from trigpoint.geodesy.projection import MapFrame
from trigpoint.landmarks.asked import (
    AnswerForm,
    ChangeAnswer,
    ChangeQuestion,
    CoverageAnswer,
    CoverageQuestion,
    LandmarkAnswer,
    LandmarkQuestion,
    Question,
)
from trigpoint.landmarks.messages import (
    decoded_change_answer,
    decoded_coverage_answer,
    decoded_landmark_answer,
    decoded_refusal,
    encoded_question,
)
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.queries import LandmarkQuery

TIMEOUT_S = 5.0
EVERYTHING = LandmarkQuery()
EVERYWHERE = CoverageQuestion()
BUSY = frozenset({"busy", "unavailable"})  # refusals that another time may not be


class MapClient:
    """Asks one map's service. May be used by several threads.

    Every question raises InputError where it is refused for what it asks, with the limit; MapUnanswered where nobody
    answers within `timeout_s` or the service cannot now; ServiceError on a closed bus.
    """

    def __init__(
        self, bus: Bus, *, root: str = DEFAULT_ROOT, map_name: str = DEFAULT_MAP, timeout_s: float = TIMEOUT_S
    ) -> None:
        self.bus, self.root, self.map_name = bus, root, map_name
        self._timeout_s = timeout_s
        self._frame: MapFrame | None = None

    def landmarks(self, query: LandmarkQuery = EVERYTHING, *, page: str = "", crs: str = "") -> LandmarkAnswer:
        """The landmarks that meet a query, a page of them; `page` is the token of the page before, `crs` one in which
        positions are given besides degrees."""
        return decoded_landmark_answer(self._asked("landmarks", LandmarkQuestion(query=query, page=page, crs=crs)))

    def pages(self, query: LandmarkQuery = EVERYTHING, *, crs: str = "") -> Iterator[LandmarkAnswer]:
        """All pages of an answer, of one version."""
        answer = self.landmarks(query, crs=crs)
        yield answer
        while answer.next_page:
            answer = self.landmarks(query, page=answer.next_page, crs=crs)
            yield answer

    def geojson(self, query: LandmarkQuery = EVERYTHING, *, page: str = "", crs: str = "") -> dict[str, Any]:
        """The same page as a GeoJSON FeatureCollection, in `crs` if one is asked for."""
        question = LandmarkQuestion(query=query, page=page, crs=crs, form=AnswerForm.GEOJSON)
        collection: dict[str, Any] = json.loads(self._asked("landmarks", question))
        return collection

    def changes(self, since: int, query: LandmarkQuery = EVERYTHING) -> ChangeAnswer:
        """What changed and what went since a version, among the landmarks that meet a query."""
        return decoded_change_answer(self._asked("changes", ChangeQuestion(query=query, since=since)))

    def coverage(self, question: CoverageQuestion = EVERYWHERE) -> CoverageAnswer:
        """Which tiles were observed when: a landmark that is absent there was looked for."""
        return decoded_coverage_answer(self._asked("coverage", question))

    def frame(self) -> MapFrame:
        """The map's frame, which never changes. Raises FrameRefused while the map has no version."""
        if self._frame is None:
            self._frame = self.landmarks(LandmarkQuery(limit=1)).map.frame()
        return self._frame

    def place(self, detections: Constellation, pose: VehiclePose) -> Placed:
        """Where detections are on the earth (in the base's frame, metres on the ground), by the vehicle's pose in the
        map. Asks for the map's frame once, and nothing else."""
        return placed(detections, pose, self.frame())

    def relocalise(
        self, observations: Constellation, gnss_prior: GnssPrior, *, expected: Expectation = EXPECTED
    ) -> Relocalised | None:
        """The pose from which landmarks are observed (in the base's frame), with a verdict on whether to rely on it;
        None where no three of them fit any place near the prior. Asks for the landmarks around."""
        around = LandmarkQuery(near=area_around(gnss_prior, observations))
        rows = [row for page in self.pages(around) for row in page.landmarks]
        return relocalised_among(rows, observations, gnss_prior, frame=self.frame(), expected=expected)

    def _asked(self, what: str, question: Question) -> bytes:
        key = map_key(ASK_PATTERN, root=self.root, map_name=self.map_name, chunks={"question": what})
        schema, payload = encoded_question(question)
        replies = self.bus.get(key, Content(payload, schema), timeout_s=self._timeout_s)
        answers = [reply.content.payload for reply in replies.items if not reply.refused]
        if answers:
            return answers[0]
        refusals = [decoded_refusal(reply.content.payload) for reply in replies.items]
        for refusal in refusals:
            if refusal.reason not in BUSY:
                raise InputError(refusal.detail)
        said = refusals[0].detail if refusals else f"nobody answers on {key} within {self._timeout_s:g} s"
        raise MapUnanswered(said)


def relocalised_among(
    landmarks: list[Landmark],
    observations: Constellation,
    gnss_prior: GnssPrior,
    *,
    frame: MapFrame,
    expected: Expectation = EXPECTED,
) -> Relocalised | None:
    """The pose from which landmarks of those given are observed, as `MapClient.relocalise` says."""
    prior = position_prior(gnss_prior, frame)
    return relocalised(on_grid(observations, frame), known_constellation(landmarks), prior, expected)


@contextmanager
def connected_client(
    settings: ZenohSettings, *, root: str = DEFAULT_ROOT, map_name: str = DEFAULT_MAP, timeout_s: float = TIMEOUT_S
) -> Iterator[MapClient]:
    """A client on a session of its own, closed in the end. Raises ServiceError where there is none to be had."""
    with ZenohBus(settings) as bus:
        yield MapClient(bus, root=root, map_name=map_name, timeout_s=timeout_s)

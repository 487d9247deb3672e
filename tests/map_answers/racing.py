"""How fast the map answers, beside a bare Zenoh queryable in the same run; how soon a client has what changed."""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import zenoh
from numpy.typing import NDArray

from bus_sessions.pairs import free_endpoint
from landmark_maps.examples import frame
from map_answers.answering import KEY, MAP, ROOT, SOON_S
from map_answers.serving import BARE_KEY, SIDE_M
from trigpoint.bus.ports import Content
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings, session_config
from trigpoint.client.asking import MapClient
from trigpoint.client.local_map import LocalMap
from trigpoint.geodesy.projection import wgs84_from_map_points
from trigpoint.landmarks.asked import LandmarkQuestion
from trigpoint.landmarks.messages import decoded_landmark_answer, encoded_question
from trigpoint.landmarks.queries import DegreeBox, LandmarkQuery

FOUND = 25  # landmarks in a box, on average
WARM_UP = 200
MILLISECONDS = 1e3

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class QueryRace:
    """Durations (n,) in s of one query: of a bare queryable, of the map's service, and of it with the answer decoded;
    and how many landmarks each answer of the service had."""

    bare_s: Floats
    answered_s: Floats
    decoded_s: Floats
    found: Floats

    def ratio(self, percentile: float) -> float:
        """The service's duration over the bare one's."""
        return float(np.percentile(self.answered_s, percentile) / np.percentile(self.bare_s, percentile))

    def decoded_ratio(self, percentile: float) -> float:
        """The same, with the landmarks decoded."""
        return float(np.percentile(self.decoded_s, percentile) / np.percentile(self.bare_s, percentile))


@contextmanager
def process(*words: str) -> Iterator["subprocess.Popen[str]"]:
    """A side of the race at work; ended in the end."""
    command = [sys.executable, "-m", "map_answers.serving", *words]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdin is not None
        assert running.stdout is not None
        try:
            if running.stdout.readline() != "ready\n":
                raise OSError(f"{' '.join(words)} ended before it was ready")
            yield running
        finally:
            running.stdin.close()
            running.wait(SOON_S)


def query_race(*, landmarks: int, queries: int, seed: int) -> QueryRace:
    """So many queries of each kind, in turn, for boxes of about 25 of the landmarks."""
    endpoint, bare_endpoint = free_endpoint(), free_endpoint()
    questions = [encoded_question(LandmarkQuestion(query=LandmarkQuery(bbox=box))) for box in boxes(landmarks, seed)]
    with (
        tempfile.TemporaryDirectory() as folder,
        process("answers", endpoint, str(landmarks)),
        ZenohBus(ZenohSettings(connect=(endpoint,))) as bus,
    ):
        assert bus.await_queryable(KEY, SOON_S)

        def answered(turn: int) -> bytes:
            schema, payload = questions[turn % len(questions)]
            (reply,) = bus.get(KEY, Content(payload, schema), timeout_s=SOON_S).items
            return reply.content.payload

        sizes = [len(answered(turn)) for turn in range(len(questions))]
        typical = Path(folder) / "answer"
        typical.write_bytes(answered(int(np.argsort(sizes)[len(sizes) // 2])))
        with (
            process("bare", bare_endpoint, str(typical)),
            zenoh.open(session_config(ZenohSettings(connect=(bare_endpoint,)))) as session,
        ):
            until_bare(session)
            return _raced(answered, lambda turn: _bare(session, questions[turn % len(questions)][1]), queries)


def _raced(answered: Callable[[int], bytes], bare: Callable[[int], bytes], queries: int) -> QueryRace:
    kinds: tuple[Callable[[int], object], ...] = (
        bare,
        answered,
        lambda turn: decoded_landmark_answer(answered(turn)),
    )
    durations_s = np.empty((queries, len(kinds)))
    for turn in range(-WARM_UP, queries):
        for number, ask in enumerate(kinds):
            began_s = time.perf_counter()
            ask(turn)
            if turn >= 0:
                durations_s[turn, number] = time.perf_counter() - began_s
    found = np.array([len(decoded_landmark_answer(answered(turn)).landmarks) for turn in range(WARM_UP)], dtype=float)
    return QueryRace(bare_s=durations_s[:, 0], answered_s=durations_s[:, 1], decoded_s=durations_s[:, 2], found=found)


def _bare(session: zenoh.Session, payload: bytes) -> bytes:
    (reply,) = session.get(BARE_KEY, payload=payload, timeout=SOON_S)
    assert reply.ok is not None
    return reply.ok.payload.to_bytes()


def until_bare(session: zenoh.Session) -> None:
    """Returns once the bare queryable is known."""
    deadline_s = time.monotonic() + SOON_S
    while not list(session.get(BARE_KEY, payload=b"", timeout=SOON_S)):
        if time.monotonic() > deadline_s:
            raise TimeoutError("the bare queryable does not answer")


def boxes(landmarks: int, seed: int) -> list[DegreeBox]:
    """Squares at random that hold about 25 of so many landmarks."""
    side_m = SIDE_M * (FOUND / landmarks) ** 0.5
    low_m = np.random.default_rng(seed).uniform(0.0, SIDE_M - side_m, (500, 2))
    south_deg, west_deg = (edge.tolist() for edge in wgs84_from_map_points(low_m, frame()))
    north_deg, east_deg = (edge.tolist() for edge in wgs84_from_map_points(low_m + side_m, frame()))
    return [
        DegreeBox(lon_min_deg=west, lat_min_deg=south, lon_max_deg=east, lat_max_deg=north)
        for west, south, east, north in zip(west_deg, south_deg, east_deg, north_deg, strict=True)
    ]


def reach_times_ms(*, versions: int, pause_s: float) -> Floats:
    """How long after each version was durable a client in another process held it, in its own map of the area."""
    endpoint = free_endpoint()
    lat_deg, lon_deg = wgs84_from_map_points(np.array([[0.0, 0.0], [SIDE_M, SIDE_M]]), frame())
    area = DegreeBox(lon_min_deg=lon_deg[0], lat_min_deg=lat_deg[0], lon_max_deg=lon_deg[1], lat_max_deg=lat_deg[1])
    held_ns = []
    with process("moving", endpoint, str(versions), str(pause_s)) as running:
        with ZenohBus(ZenohSettings(connect=(endpoint,))) as bus:
            assert bus.await_queryable(KEY, SOON_S)
            client = MapClient(bus, root=ROOT, map_name=MAP, timeout_s=SOON_S)
            with LocalMap(client, area, look_s=3600.0) as local:
                assert local.await_version(1, SOON_S)
                assert running.stdin is not None
                running.stdin.write("go\n")
                running.stdin.flush()
                for version in range(2, versions + 2):
                    assert local.await_version(version, SOON_S), f"version {version} did not come"
                    held_ns.append(time.monotonic_ns())
        running.stdin.close()
        assert running.stdout is not None
        durable_ns = json.loads(running.stdout.readline())
    return np.asarray((np.array(held_ns) - np.array(durable_ns)) / 1e6, dtype=np.float64)

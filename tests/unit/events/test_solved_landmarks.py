"""Landmarks decoded side by side: the same as each decoded by itself."""

from collections.abc import Sequence
from dataclasses import replace

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from event_examples.any_event import ANY_EVENT, same_event
from landmark_maps.examples import solved_landmark
from trigpoint.errors import EventRejected
from trigpoint.events.codec import decode, encode
from trigpoint.events.mapped import LandmarkSolved
from trigpoint.events.solved_landmarks import (
    KNOWN_BYTES,
    KNOWN_LENGTH,
    SCHEMA,
    LandmarkDecoder,
    Observations,
    SolvedLandmarks,
    by_drive,
)
from trigpoint_schemas.v1 import mapped_pb2

unhurried = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])  # large values
any_landmark = ANY_EVENT[LandmarkSolved]
UNKNOWN_FIELD = b"\xa0\x06\x01"  # number 100, which no schema has yet


def payload_of(event: object) -> bytes:
    assert isinstance(event, LandmarkSolved)
    return encode(event)[1]


any_payload = any_landmark.map(payload_of)
parts = st.lists(any_payload, min_size=2, max_size=2).map(b"".join)  # Protobuf takes them for one message
odd_payload = (
    any_payload
    | parts
    | any_payload.map(lambda payload: payload + UNKNOWN_FIELD)
    | any_payload.map(lambda payload: UNKNOWN_FIELD + payload)
)
broken_payload = st.binary(max_size=60) | st.tuples(any_payload, st.integers(1, 40)).map(lambda cut: cut[0][: -cut[1]])


def row_of(solved: SolvedLandmarks, row: int) -> LandmarkSolved:
    return LandmarkSolved(
        map_version=int(solved.map_versions[row]),
        landmark=solved.landmarks[row],
        kind=solved.kinds[row],
        signature=solved.signatures[row],
        position_m=solved.positions_m[row],
        covariance_m2=solved.covariances_m2[row],
        observation_count=int(solved.observation_counts[row]),
        vehicles=solved.vehicles[row],
        first_seen_ns=int(solved.first_seen_ns[row]),
        last_seen_ns=int(solved.last_seen_ns[row]),
        anchors=solved.anchors[row],
        observations=_flat(solved.observations[row]),
    )


def _flat(observations: Observations) -> tuple[tuple[str, str, int], ...]:
    return tuple((*drive, sequence) for drive, sequences in observations.items() for sequence in sequences)


def one_by_one(payloads: Sequence[bytes]) -> list[LandmarkSolved] | str:
    """The events, their observations in order of drives, or why one of them cannot be decoded."""
    try:
        events = [event for payload in payloads if isinstance(event := decode(SCHEMA, payload), LandmarkSolved)]
        return [replace(event, observations=_flat(by_drive(event.observations))) for event in events]
    except EventRejected as error:
        return str(error)


def side_by_side(payloads: Sequence[bytes]) -> list[LandmarkSolved] | str:
    try:
        solved = LandmarkDecoder().decoded(payloads)
    except EventRejected as error:
        return str(error)
    return [row_of(solved, row) for row in range(len(solved))]


def same(payloads: Sequence[bytes]) -> bool:
    ours, theirs = side_by_side(payloads), one_by_one(payloads)
    if isinstance(ours, str) or isinstance(theirs, str):
        return ours == theirs
    return len(ours) == len(theirs) and all(map(same_event, ours, theirs))


@unhurried
@given(st.lists(any_payload, max_size=4))
def test_any_landmarks_are_the_same_side_by_side_as_one_by_one(payloads: list[bytes]) -> None:
    assert same(payloads)


@unhurried
@given(st.lists(odd_payload, max_size=2))
def test_landmarks_of_another_writer_s_layout_are_the_same(payloads: list[bytes]) -> None:
    assert same(payloads)


@unhurried
@given(st.lists(any_payload | broken_payload, max_size=3))
def test_bytes_that_are_no_landmark_are_refused_as_the_codec_refuses_them(payloads: list[bytes]) -> None:
    assert same(payloads)


def test_a_landmark_of_very_many_vehicles_is_the_same() -> None:
    crowd = replace(solved_landmark("L1", 1.0, 2.0), vehicles=tuple(f"veh-{number}" for number in range(200)))
    assert same([payload_of(solved_landmark("L0", 0.0, 0.0)), payload_of(crowd)])


def test_a_landmark_whose_position_has_three_numbers_is_refused() -> None:
    message = mapped_pb2.LandmarkSolved(position_m=[1.0, 2.0, 3.0], covariance_m2=[1.0, 0.0, 0.0, 1.0])
    with pytest.raises(EventRejected, match="3 numbers, expected 2"):
        LandmarkDecoder().decoded([message.SerializeToString()])


def test_texts_that_come_again_are_the_same_after_others_were_forgotten_for_them() -> None:
    decoder = LandmarkDecoder()
    events = [
        replace(solved_landmark("L1", 0.0, 0.0), vehicles=(f"{number:0{KNOWN_LENGTH - 100}}",))
        for number in range(2 * KNOWN_BYTES // KNOWN_LENGTH)
    ]
    found = [row_of(decoder.decoded([payload_of(event)]), 0) for event in (*events, *events)]
    assert all(map(same_event, found, (*events, *events)))


def test_rows_are_picked_in_the_order_asked_for() -> None:
    solved = LandmarkDecoder().decoded([payload_of(solved_landmark(f"L{n}", n, 0.0)) for n in range(4)])
    picked = solved.picked(np.array([2, 0]))
    assert (picked.landmarks, picked.positions_m[:, 0].tolist()) == (["L2", "L0"], [2.0, 0.0])

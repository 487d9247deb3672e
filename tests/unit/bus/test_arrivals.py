"""Transmissions read column by column."""

from collections.abc import Sequence

import pytest

from trigpoint.bus.arrivals import Arrival, messages_of, runs_of_key
from trigpoint.bus.attachment import BUNDLE_LIMIT, encode_attachment, encode_bundle
from trigpoint.bus.ports import UNIDENTIFIED, BusMessage
from trigpoint.events.envelope import EventIdentity
from trigpoint.events.runs import EncodedRun

KEY, SCHEMA = "t/v1/veh/a/obs/imu", "t.Imu"


def bundle(sequences: Sequence[int], *, size_bytes: int = 8, source: str = "a") -> Arrival:
    parts = [
        (encode_attachment(EventIdentity(source, "boot", number), stamp_ns=10 * number, schema_version=1), payload)
        for number in sequences
        for payload in [number.to_bytes(8, "little").ljust(size_bytes, b"x")[:size_bytes]]
    ]
    attachment, payload = encode_bundle(parts)
    return Arrival(KEY, SCHEMA, payload, attachment)


def cut(arrival: Arrival, size_bytes: int) -> Arrival:
    return Arrival(arrival.key, arrival.schema_name, arrival.payload[:-size_bytes], arrival.attachment)


def rows(run: EncodedRun) -> list[tuple[str, int, int, bytes]]:
    return [
        (run.source, sequence, stamp_ns, payload)
        for sequence, stamp_ns, payload in zip(
            run.sequences.tolist(), run.stamps_ns.tolist(), run.payloads, strict=True
        )
    ]


def rows_of_messages(messages: Sequence[BusMessage]) -> list[tuple[str, int, int, bytes]]:
    return [(one.identity.source, one.identity.sequence, one.stamp_ns, one.payload) for one in messages]


def test_bundles_of_a_drive_become_one_run() -> None:
    (found,) = runs_of_key([bundle(range(3)), bundle(range(3, 7)), bundle([7])])
    assert found.run.sequences.tolist() == list(range(8))


@pytest.mark.parametrize(
    "arrivals",
    [
        [bundle([0, 1]), bundle([2, 3], size_bytes=5), bundle([4])],
        [bundle([0, 1]), bundle([2], source="b"), bundle([3])],
        [bundle([0, 1]), Arrival(KEY, SCHEMA, b"foreign", b""), bundle([2])],
        [bundle([0, 1]), cut(bundle([2, 3]), 3), bundle([4, 5])],
        [cut(bundle([0, 1]), 8), bundle([2, 3])],
        [bundle([0]), bundle([1]), bundle([2, 3]), bundle([], size_bytes=1)],
    ],
    ids=["lengths", "drives", "foreign", "cut", "cut first", "empty"],
)
def test_what_is_received_together_is_what_each_transmission_holds(arrivals: list[Arrival]) -> None:
    together = [row for found in runs_of_key(arrivals) for row in rows(found.run)]
    assert together == rows_of_messages([message for arrival in arrivals for message in messages_of(arrival)])


def test_a_bundle_that_is_cut_off_spoils_no_other() -> None:
    found = list(runs_of_key([bundle([0, 1]), cut(bundle([2, 3]), 3), bundle([4, 5])]))
    assert [run.run.sequences.tolist() for run in found] == [[0, 1], [UNIDENTIFIED.sequence], [4, 5]]


def test_more_than_a_bundle_may_hold_stays_apart() -> None:
    half = BUNDLE_LIMIT // 2 + 1
    found = list(runs_of_key([bundle(range(half)), bundle(range(half, 2 * half))]))
    assert [len(run.run) for run in found] == [half, half]

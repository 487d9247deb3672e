"""One drive's events put in order of time and numbered, as a vehicle would have sent them."""

import hashlib
import heapq
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import Observed, VehicleDescribed
from trigpoint.events.truth import Truth
from trigpoint.events.truth_objects import TruthObject

Timed = tuple[int, Observed]
BOOT_ID_DIGITS = 16  # 64 bits of SHA-256: enough to tell drives apart


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """Everything one vehicle said in one boot, numbered from 0 in order of stamp."""

    vehicle: str
    rows: Sequence[Envelope[Observed]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Conversion:
    """What a source holds: recordings, and kept apart from them truth, a simulated world's objects, and anchors;
    `remarks` for a person to read."""

    recordings: tuple[Recording, ...]
    truth: Truth
    anchors: tuple[AnchorLabelled, ...]
    remarks: tuple[str, ...] = ()
    objects: tuple[TruthObject, ...] = ()


def boot_id_of(*parts: bytes) -> str:
    """A boot's name that depends on its source data alone: the same data give the same name."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "big"))
        digest.update(part)
    return digest.hexdigest()[:BOOT_ID_DIGITS]


def recording_of(described: VehicleDescribed, timed: Iterable[Timed], *, boot_id: str) -> Recording:
    """A recording that opens with the vehicle's description; events of one instant keep the order given."""
    ordered = sorted(timed, key=lambda pair: pair[0])
    first_stamp_ns = ordered[0][0] if ordered else 0
    vehicle = described.vehicle
    described_first: list[Timed] = [(first_stamp_ns, described)]
    rows = tuple(
        Envelope(EventIdentity(vehicle, boot_id, sequence), stamp_ns, event)
        for sequence, (stamp_ns, event) in enumerate(described_first + ordered)
    )
    return Recording(vehicle=vehicle, rows=rows)


def merged_rows(
    described: VehicleDescribed, streams: Iterable[Iterable[Timed]], *, boot_id: str
) -> Iterator[Envelope[Observed]]:
    """As a recording's rows, from streams that are each in order of stamp, one event of each in memory at a time.

    A stream that goes back in time keeps its own order.
    """
    merged = heapq.merge(*streams, key=lambda pair: pair[0])
    first = next(merged, None)
    opening: list[Timed] = [(0, described)] if first is None else [(first[0], described), first]
    for sequence, (stamp_ns, event) in enumerate(chain(opening, merged)):
        yield Envelope(EventIdentity(described.vehicle, boot_id, sequence), stamp_ns, event)


def rows_with(recording: Recording, streams: Iterable[Iterable[Timed]]) -> Iterator[Envelope[Observed]]:
    """A recording's rows numbered anew with those of streams among them, each in order of stamp."""
    described, *others = recording.rows
    timed: list[Timed] = [(row.stamp_ns, row.event) for row in others]
    event = described.event
    if not isinstance(event, VehicleDescribed):
        raise TypeError(f"a recording opens with {type(event).__name__}, not with VehicleDescribed")
    return merged_rows(event, (timed, *streams), boot_id=described.identity.boot_id)


def nearly_ordered(timed: Iterable[Timed], *, span_ns: int) -> Iterator[Timed]:
    """Events that came late by up to `span_ns` put in order of stamp; what came later still keeps its place."""
    waiting: list[tuple[int, int, Observed]] = []
    newest_ns = 0
    for number, (stamp_ns, event) in enumerate(timed):
        newest_ns = max(newest_ns, stamp_ns)
        heapq.heappush(waiting, (stamp_ns, number, event))
        while newest_ns - waiting[0][0] > span_ns:
            stamp_ns, _, event = heapq.heappop(waiting)
            yield stamp_ns, event
            if not waiting:
                break
    for stamp_ns, _, event in sorted(waiting, key=lambda row: row[:2]):
        yield stamp_ns, event

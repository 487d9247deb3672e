"""One drive's events put in order of time and numbered, as a vehicle would have sent them."""

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

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

"""LandmarkSolved events column by column, as many as came together: decoded side by side instead of one by one."""

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from trigpoint.events.codec import decode, schema_name
from trigpoint.events.mapped import LandmarkSolved
from trigpoint.events.payload_walk import PayloadWalk
from trigpoint_schemas.v1 import mapped_pb2

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
MeaningT = TypeVar("MeaningT")
Names = tuple[str, ...]
Observations = Mapping[tuple[str, str], Sequence[int]]
"""Of each drive (vehicle, boot_id) the sequences of the sweeps that saw a landmark; thousands take little room so."""

NAMES_BYTES = 4 * 1024 * 1024  # of names kept: they come again with every version
KNOWN_BYTES = 256 * 1024  # of other texts whose meaning is kept; what is kept takes some ten times that
KNOWN_LENGTH = 512  # bytes of such a text; longer ones hardly come again
SCHEMA = schema_name(LandmarkSolved)
FIELD = mapped_pb2.LandmarkSolved.DESCRIPTOR.fields_by_name
UNSEEN: Observations = {}
VARINT, FIXED64, LENGTH = 0, 1, 2  # wire types (protobuf.dev, Encoding)


@dataclass(frozen=True, slots=True, kw_only=True)
class SolvedLandmarks:
    """Landmarks row by row: of each the same as in LandmarkSolved, numbers as (n,), positions (n, 2) in m and
    covariances (n, 2, 2) in m^2.
    """

    map_versions: Ints
    landmarks: Sequence[str]
    kinds: Sequence[str]
    signatures: Sequence[str]
    positions_m: Floats
    covariances_m2: Floats
    observation_counts: Ints
    vehicles: Sequence[Names]
    first_seen_ns: Ints
    last_seen_ns: Ints
    anchors: Sequence[Names]
    observations: Sequence[Observations]

    def __len__(self) -> int:
        return len(self.landmarks)

    def picked(self, rows: Ints) -> "SolvedLandmarks":
        """The rows of these numbers, in their order."""
        if len(rows) == len(self) and bool((rows == np.arange(len(rows))).all()):
            return self
        numbers = rows.tolist()
        return SolvedLandmarks(
            map_versions=self.map_versions[rows],
            landmarks=[self.landmarks[row] for row in numbers],
            kinds=[self.kinds[row] for row in numbers],
            signatures=[self.signatures[row] for row in numbers],
            positions_m=self.positions_m[rows],
            covariances_m2=self.covariances_m2[rows],
            observation_counts=self.observation_counts[rows],
            vehicles=[self.vehicles[row] for row in numbers],
            first_seen_ns=self.first_seen_ns[rows],
            last_seen_ns=self.last_seen_ns[rows],
            anchors=[self.anchors[row] for row in numbers],
            observations=[self.observations[row] for row in numbers],
        )


def in_columns(events: Sequence[LandmarkSolved]) -> SolvedLandmarks:
    """The events as columns."""
    return SolvedLandmarks(
        map_versions=np.array([row.map_version for row in events], dtype=np.int64),
        landmarks=[row.landmark for row in events],
        kinds=[row.kind for row in events],
        signatures=[row.signature for row in events],
        positions_m=np.array([row.position_m for row in events], dtype=np.float64).reshape(-1, 2),
        covariances_m2=np.array([row.covariance_m2 for row in events], dtype=np.float64).reshape(-1, 2, 2),
        observation_counts=np.array([row.observation_count for row in events], dtype=np.int64),
        vehicles=[row.vehicles for row in events],
        first_seen_ns=np.array([row.first_seen_ns for row in events], dtype=np.int64),
        last_seen_ns=np.array([row.last_seen_ns for row in events], dtype=np.int64),
        anchors=[row.anchors for row in events],
        observations=[by_drive(row.observations) for row in events],
    )


def by_drive(observations: Iterable[tuple[str, str, int]]) -> Observations:
    """Observations (vehicle, boot_id, sequence) grouped by drive, in order of the drives' first ones."""
    grouped: dict[tuple[str, str], array[int]] = {}
    for vehicle, boot_id, sequence in observations:
        sequences = grouped.get((vehicle, boot_id))
        if sequences is None:
            sequences = grouped[vehicle, boot_id] = array("q")
        sequences.append(sequence)
    return grouped


class LandmarkDecoder:
    """Decodes payloads of LandmarkSolved, many at once; it remembers what texts meant that come again and again."""

    def __init__(self) -> None:
        self._names = _Known(_names_of, limit_bytes=NAMES_BYTES)
        self._vehicles = _Known(_vehicles_of, limit_bytes=KNOWN_BYTES)
        self._seen = _Known(_seen_of, limit_bytes=KNOWN_BYTES)

    def decoded(self, payloads: Sequence[bytes]) -> SolvedLandmarks:
        """The landmarks of the payloads, each as the codec decodes it. Raises EventRejected as it does."""
        walk = PayloadWalk(payloads)
        map_versions = walk.whole_numbers(_tag("map_version", VARINT))
        names = self._names.meanings(walk.parts([_tag(name, LENGTH) for name in ("landmark", "kind", "signature")]))
        positions_m = walk.packed_doubles(_tag("position_m", LENGTH), 2)
        covariances_m2 = walk.packed_doubles(_tag("covariance_m2", LENGTH), 4)
        counts = walk.whole_numbers(_tag("observation_count", VARINT))
        vehicles = self._vehicles.meanings(walk.repeated(_tag("vehicles", LENGTH)))
        first_seen_ns = walk.fixed_numbers(_tag("first_seen_ns", FIXED64))
        last_seen_ns = walk.fixed_numbers(_tag("last_seen_ns", FIXED64))
        seen = self._seen.meanings(walk.rest())
        plain = SolvedLandmarks(
            map_versions=map_versions,
            landmarks=[name[0] if name else "" for name in names],
            kinds=[name[1] if name else "" for name in names],
            signatures=[name[2] if name else "" for name in names],
            positions_m=positions_m,
            covariances_m2=covariances_m2.reshape(-1, 2, 2),
            observation_counts=counts,
            vehicles=[one or () for one in vehicles],
            first_seen_ns=first_seen_ns,
            last_seen_ns=last_seen_ns,
            anchors=[one[0] if one else () for one in seen],
            observations=[one[1] if one else UNSEEN for one in seen],
        )
        for texts in (names, vehicles, seen):
            if None in texts:
                walk.differs |= np.array([text is None for text in texts])
        return _mended(plain, payloads, np.flatnonzero(walk.differs))


def _mended(plain: SolvedLandmarks, payloads: Sequence[bytes], rows: Ints) -> SolvedLandmarks:
    """The landmarks, those of these rows decoded one by one."""
    if not len(rows):
        return plain
    events = [decode(SCHEMA, payloads[row]) for row in rows.tolist()]
    order = np.arange(len(plain))
    order[rows] = len(plain) + np.arange(len(rows))
    return _joined(plain, in_columns([event for event in events if isinstance(event, LandmarkSolved)])).picked(order)


def _joined(first: SolvedLandmarks, second: SolvedLandmarks) -> SolvedLandmarks:
    return SolvedLandmarks(
        map_versions=np.concatenate([first.map_versions, second.map_versions]),
        landmarks=[*first.landmarks, *second.landmarks],
        kinds=[*first.kinds, *second.kinds],
        signatures=[*first.signatures, *second.signatures],
        positions_m=np.concatenate([first.positions_m, second.positions_m]),
        covariances_m2=np.concatenate([first.covariances_m2, second.covariances_m2]),
        observation_counts=np.concatenate([first.observation_counts, second.observation_counts]),
        vehicles=[*first.vehicles, *second.vehicles],
        first_seen_ns=np.concatenate([first.first_seen_ns, second.first_seen_ns]),
        last_seen_ns=np.concatenate([first.last_seen_ns, second.last_seen_ns]),
        anchors=[*first.anchors, *second.anchors],
        observations=[*first.observations, *second.observations],
    )


class _Known(Generic[MeaningT]):
    """What parts of payloads mean: looked up where it is known, worked out where it is not; None for no meaning."""

    def __init__(self, meaning: Callable[[bytes], MeaningT | None], *, limit_bytes: int) -> None:
        self._meaning, self._limit_bytes = meaning, limit_bytes
        self._known: dict[bytes, MeaningT] = {}
        self._bytes = 0

    def meanings(self, parts: Sequence[bytes]) -> list[MeaningT | None]:
        """Of each part what it means."""
        found = list(map(self._known.get, parts))
        if None in found:
            found = [self._learnt(part) if one is None else one for part, one in zip(parts, found, strict=True)]
        return found

    def _learnt(self, part: bytes) -> MeaningT | None:
        found = self._known.get(part) or self._meaning(part)
        if found is not None and len(part) <= KNOWN_LENGTH and part not in self._known:
            if self._bytes > self._limit_bytes:
                self._known, self._bytes = {}, 0
            self._known[part] = found
            self._bytes += len(part)
        return found


def _tag(field: str, wire_type: int) -> int:
    return FIELD[field].number << 3 | wire_type


def _names_of(part: bytes) -> Names | None:
    message = _message(part)
    return None if message is None else (message.landmark, message.kind, message.signature)


def _vehicles_of(part: bytes) -> Names | None:
    message = _message(part)
    return None if message is None else tuple(message.vehicles)


def _seen_of(part: bytes) -> tuple[Names, Observations] | None:
    """Anchors and observations; None where anything else is there."""
    message = _message(part)
    if message is None or any(field.name not in ("anchors", "observations") for field, _ in message.ListFields()):
        return None
    sweeps = ((sweep.vehicle, sweep.boot_id, sweep.sequence) for sweep in message.observations)
    return tuple(message.anchors), by_drive(sweeps)


def _message(part: bytes) -> mapped_pb2.LandmarkSolved | None:
    try:
        return mapped_pb2.LandmarkSolved.FromString(part)
    except DecodeError:
        return None

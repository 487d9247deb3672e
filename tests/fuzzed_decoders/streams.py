"""Vehicles' valid messages among malformed ones, through a whole ingest: every valid one has to be in the log."""

import math
import random
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from trigpoint.bus.arrivals import Arrival, runs_of
from trigpoint.bus.attachment import encode_attachment, encode_bundle
from trigpoint.bus.memory_bus import MemoryBus, MemoryExchange
from trigpoint.events.codec import Event, encode, schema_name
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import (
    GnssFixReceived,
    ImuMeasured,
    LandmarkDetection,
    LandmarksDetected,
    VehicleDescribed,
    WheelSpeedMeasured,
)
from trigpoint.events.uplink import uplink_key
from trigpoint.logs.memory_log import MemoryLog
from trigpoint_ingest.app import IngestService
from trigpoint_ingest.settings import IngestSettings

VEHICLES = ("veh-a", "veh-b", "veh-c")
BOOT = "boot-1"
START_NS, STEP_NS = 1_700_000_000_000_000_000, 10_000_000
LIMIT_BYTES = 4096  # of a payload
TOGETHER_AT_MOST = 40  # messages of a bundle
PUBLISHED_BETWEEN_STEPS = 25
SETTINGS = IngestSettings(batch_count=500, message_limit_bytes=LIMIT_BYTES)


@dataclass(frozen=True, slots=True)
class _Sent:
    """One message as its sender made it; `event` None where it is malformed."""

    key: str
    schema: str
    identity: EventIdentity
    stamp_ns: int
    payload: bytes
    event: Event | None

    @property
    def part(self) -> tuple[bytes, bytes]:
        return encode_attachment(self.identity, stamp_ns=self.stamp_ns, schema_version=1), self.payload


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamTally:
    """How many messages were sent, how many of them valid; of those how many the log lacks or has changed, has twice,
    or out of order; and how many malformed ones it has."""

    sent: int
    valid: int
    lost: int
    doubled: int
    disordered: int
    malformed_kept: int


@dataclass(slots=True)
class _Vehicle:
    """A vehicle that numbers what it sends."""

    name: str
    die: random.Random
    sequence: int = 0
    valid: list[Envelope[Event]] = field(default_factory=list)
    malformed: set[EventIdentity] = field(default_factory=set)

    def next_valid(self) -> _Sent:
        event = VehicleDescribed(vehicle=self.name) if self.sequence == 0 else _measured(self.die)
        sent = self._sent(event, *encode(event))
        self.valid.append(Envelope(sent.identity, sent.stamp_ns, event))
        self.sequence += 1
        return sent

    def next_malformed(self) -> _Sent:
        """Under a number of its own."""
        sent = self.to_be_mended()
        self.malformed.add(sent.identity)
        self.sequence += 1
        return sent

    def to_be_mended(self) -> _Sent:
        """A malformed message under the number of the next valid one."""
        event = _measured(self.die)
        schema, payload = encode(event)
        kind = self.die.choice(("cut", "value", "schema", "size", "stamp"))
        if kind == "value":
            return self._sent(None, *encode(_wrong(self.die)))
        if kind == "schema":
            return replace(
                self._sent(None, schema, payload), schema=self.die.choice(("", "x.v1.Y", "trigpoint.v1.MapSolved"))
            )
        if kind == "size":
            return self._sent(None, schema, payload + bytes(LIMIT_BYTES))
        if kind == "stamp":
            return replace(self._sent(None, schema, payload), stamp_ns=-self.die.randrange(1, 2**62))
        imu = encode(ImuMeasured(yaw_rate_radps=1.0, acceleration_x_mps2=1.0, acceleration_y_mps2=1.0))
        return self._sent(None, imu[0], imu[1][: self.die.choice((1, 4, 8, 12, 20, 26))])  # inside of a field

    def _sent(self, event: Event | None, schema: str, payload: bytes) -> _Sent:
        key = uplink_key(self.name, type(event) if event is not None else None)
        identity = EventIdentity(self.name, BOOT, self.sequence)
        return _Sent(key, schema, identity, START_NS + self.sequence * STEP_NS, payload, event)


def _measured(die: random.Random) -> Event:
    """A valid event of chance."""
    value = die.uniform(-1.0, 1.0)
    seen = LandmarkDetection(range_m=9.0 + value, bearing_rad=value, kind="pole", signature="", diameter_m=math.nan)
    return die.choice(
        (
            ImuMeasured(yaw_rate_radps=value, acceleration_x_mps2=value, acceleration_y_mps2=math.nan),
            WheelSpeedMeasured(speed_mps=3.0 + value, steering_rad=value / 2.0, yaw_rate_radps=math.nan),
            GnssFixReceived(lat_deg=-33.8 + value / 1e3, lon_deg=151.2, height_m=math.nan, sigma_m=3.0),
            LandmarksDetected(detections=(seen,) * die.randrange(4)),
        )
    )


def _wrong(die: random.Random) -> Event:
    """An event with a value no sensor has."""
    far = die.choice((math.nan, math.inf, -math.inf, 1e9, -1e300))
    seen = LandmarkDetection(range_m=far, bearing_rad=0.0, kind="", signature="", diameter_m=math.nan)
    return die.choice(
        (
            ImuMeasured(yaw_rate_radps=far, acceleration_x_mps2=0.0, acceleration_y_mps2=0.0),
            WheelSpeedMeasured(speed_mps=far, steering_rad=0.0, yaw_rate_radps=0.0),
            GnssFixReceived(lat_deg=far, lon_deg=0.0, height_m=0.0, sigma_m=3.0),
            GnssFixReceived(lat_deg=0.0, lon_deg=0.0, height_m=0.0, sigma_m=3.0),
            LandmarksDetected(detections=(seen,)),
        )
    )


def _transmissions(vehicles: list[_Vehicle], die: random.Random, count: int) -> Iterator[tuple[Arrival, int]]:
    """About `count` messages as they travel, and how many each transmission holds; 0 where it is to be dealt with
    before the next one comes: that one mends it."""
    made = 0
    while made < count:
        vehicle = die.choice(vehicles)
        if vehicle.sequence and die.random() < 0.1:
            made += 1
            yield _bundle([vehicle.to_be_mended()]), 0
        together = 1 if vehicle.sequence == 0 else die.randint(1, TOGETHER_AT_MOST)
        messages = [
            vehicle.next_malformed() if vehicle.sequence and die.random() < 0.3 else vehicle.next_valid()
            for _ in range(together)
        ]
        made += together
        for noise in _noise(vehicle, die):
            made += 1
            yield noise, 1
        for stretch in _stretches(messages):
            bundle = _bundle(stretch)
            if die.random() < 0.1:  # the transmission breaks off, is not acknowledged, and comes again
                yield replace(bundle, payload=bundle.payload[: -die.randint(1, 5)]), 1
            yield bundle, len(stretch)


def _stretches(messages: list[_Sent]) -> Iterator[list[_Sent]]:
    """Neighbours of one key and one schema travel together."""
    stretch: list[_Sent] = []
    for message in messages:
        if stretch and (message.key, message.schema) != (stretch[0].key, stretch[0].schema):
            yield stretch
            stretch = []
        stretch.append(message)
    yield stretch


def _bundle(messages: list[_Sent]) -> Arrival:
    attachment, payload = encode_bundle([message.part for message in messages])
    return Arrival(messages[0].key, messages[0].schema, payload, attachment)


def _noise(vehicle: _Vehicle, die: random.Random) -> Iterator[Arrival]:
    """What comes on a vehicle's key and is nobody's: no attachment of ours, or one in another's name."""
    key, schema = uplink_key(vehicle.name, ImuMeasured), schema_name(ImuMeasured)
    payload = encode(ImuMeasured(yaw_rate_radps=9.0, acceleration_x_mps2=0.0, acceleration_y_mps2=0.0))[1]
    if die.random() < 0.3:
        yield Arrival(key, schema, payload, die.randbytes(die.randrange(12)))
    if die.random() < 0.3:
        other = die.choice([name for name in (*VEHICLES, "", "nobody") if name != vehicle.name])
        identity = EventIdentity(other, BOOT, die.randrange(200))
        yield Arrival(key, schema, payload, encode_attachment(identity, stamp_ns=START_NS, schema_version=1))


def ingested_stream(*, count: int, seed: int) -> StreamTally:
    """What becomes of about `count` messages, a third of them malformed, in the log of an ingest."""
    die, log, exchange = random.Random(seed), MemoryLog(), MemoryExchange()
    vehicles = [_Vehicle(name, die) for name in VEHICLES]
    sent = 0
    with (
        MemoryBus(exchange) as sender,
        MemoryBus(exchange) as receiver,
        IngestService(log, receiver, SETTINGS) as service,
    ):
        for number, (arrival, held) in enumerate(_transmissions(vehicles, die, count)):
            sent += max(held, 1)
            for run in runs_of(arrival):
                sender.publish_run(run)
            if held == 0 or number % PUBLISHED_BETWEEN_STEPS == 0:
                _settle(service)
            if held == 0:
                service.flush()
        _settle(service)
    return _tally(vehicles, log, sent)


def _settle(service: IngestService) -> None:
    while service.step(0.0):
        pass


def _tally(vehicles: list[_Vehicle], log: MemoryLog, sent: int) -> StreamTally:
    lost = doubled = disordered = kept = 0
    for vehicle in vehicles:
        rows = [row.envelope for row in log.read(f"veh-{vehicle.name}")]
        logged = {row.identity: row for row in rows}
        counts = Counter(row.identity for row in rows)
        lost += sum(encode_row(row) != encode_row(logged.get(row.identity)) for row in vehicle.valid)
        doubled += sum(count - 1 for count in counts.values())
        sequences = [row.identity.sequence for row in rows]
        disordered += sum(later < earlier for earlier, later in zip(sequences, sequences[1:], strict=False))
        kept += sum(identity in logged for identity in vehicle.malformed)
    valid = sum(len(vehicle.valid) for vehicle in vehicles)
    return StreamTally(sent=sent, valid=valid, lost=lost, doubled=doubled, disordered=disordered, malformed_kept=kept)


def encode_row(row: Envelope[Event] | None) -> tuple[int, str, bytes] | None:
    """A row as it is compared: NaN equals NaN."""
    return None if row is None else (row.stamp_ns, *encode(row.event))

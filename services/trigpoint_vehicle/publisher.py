"""What a vehicle embeds: each event is numbered and spooled to disk, then sent until ingest has acknowledged it.

Importing this loads what a vehicle needs: Zenoh, Protobuf, numpy. No factor graph, no database, no projections.
"""

import atexit
import logging
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self, get_args

from trigpoint.bus.ports import Bus
from trigpoint.bus.zenoh_bus import ZenohSettings
from trigpoint.errors import EventRejected, InputError, ServiceError
from trigpoint.events.codec import encode
from trigpoint.events.envelope import EncodedMessage, EventIdentity
from trigpoint.events.keys import valid_name
from trigpoint.events.observed import Observed, VehicleDescribed
from trigpoint_vehicle.core.spool_records import SpoolChannel
from trigpoint_vehicle.forwarding import Forwarder
from trigpoint_vehicle.link import Link
from trigpoint_vehicle.settings import VehicleSettings
from trigpoint_vehicle.spool import Behind, Spool

OBSERVED = frozenset(get_args(Observed))
IDLE_S = 0.2  # between two looks of a publisher that has nothing to do
CLOSE_LONGEST_S = 15.0  # a session that is stalled holds a publication for 5 s before it gives up

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sent:
    """What became of a publisher's messages since it was opened: `sent` counts each time, `resent` all but the first;
    `dropped` went from a full spool, `damaged_bytes` of it could not be read. `sessions` counts those on the bus.
    """

    sent: int
    resent: int
    acknowledged: int
    dropped: int
    damaged_bytes: int
    sessions: int


class VehiclePublisher:
    """Sends one vehicle's events: `describe` first, then `send`, from any thread; close it or leave its `with`.

    What `send` returned for survives the death of the process, and a few milliseconds later a loss of power; it is
    sent only then. What an earlier boot left in the folder is sent first, under its own boot. Given settings instead
    of a bus, it has a session of its own and opens it anew when nothing is acknowledged for long.

    Raises InputError for a name that cannot be a vehicle's, a folder that cannot be a spool, or another's spool.
    """

    def __init__(
        self,
        vehicle: str,
        spool_dir: Path,
        bus: Bus | ZenohSettings,
        settings: VehicleSettings | None = None,
        *,
        now_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._settings = settings if settings is not None else VehicleSettings()
        self.vehicle, self.boot_id = valid_name(vehicle), secrets.token_hex(8)
        self._spool = Spool(spool_dir, vehicle, self.boot_id, self._settings, now_ns=now_ns)
        self._forwarder = Forwarder(self._spool, vehicle, self._settings)
        self._link = Link(bus, reopen_after_s=self._settings.reopen_after_s)
        self._mutex = threading.Lock()
        self._drained = threading.Condition()
        self._unsynced = threading.Event()
        self._wake = threading.Event()
        self._stop = threading.Event()
        self._channels: dict[tuple[str, str], SpoolChannel] = {}
        self._next_sequence = 0
        self._failure: Exception | None = None
        self._threads = (
            threading.Thread(target=self._run, args=(self._sync,), name=f"publisher's spool of {vehicle}", daemon=True),
            threading.Thread(target=self._run, args=(self._turn,), name=f"publisher of {vehicle}", daemon=True),
        )
        for thread in self._threads:
            thread.start()
        atexit.register(self.close)  # an open session would hang the interpreter's exit

    def describe(self, event: VehicleDescribed, *, stamp_ns: int) -> EventIdentity:
        """The identity of the description, the first event of a boot; raises as `send` does."""
        if event.vehicle != self.vehicle:
            raise InputError(f"{self.vehicle!r} cannot describe {event.vehicle!r}")
        return self._send(event, stamp_ns)

    def send(self, event: Observed, *, stamp_ns: int) -> EventIdentity:
        """The identity the event got; it is spooled and will be sent.

        Raises InputError for one that no vehicle sends, cannot be encoded, is too large, or comes before the
        description; AppendFailed while the spool or its disk is full; ServiceError once closed or failed.
        """
        if not self._next_sequence and type(event) is not VehicleDescribed:
            raise InputError(f"{self.vehicle!r} has not described itself in this boot: call describe first")
        if type(event) is VehicleDescribed:
            return self.describe(event, stamp_ns=stamp_ns)
        return self._send(event, stamp_ns)

    def _send(self, event: Observed, stamp_ns: int) -> EventIdentity:
        if type(event) not in OBSERVED:
            raise InputError(f"{type(event).__name__} is not what a vehicle sends")
        schema_name, payload = encode(event)
        self._require_fitting(payload)
        channel = self._channel(self.boot_id, schema_name)
        with self._mutex:
            self._require_open()
            sequence = self._next_sequence
            self._spool.append(channel, sequence, stamp_ns, payload)
            self._next_sequence = sequence + 1
        self._wake_up()
        return EventIdentity(self.vehicle, self.boot_id, sequence)

    def forward(self, message: EncodedMessage) -> None:
        """A message of a log of this vehicle, spooled and sent under the identity it has.

        Raises InputError for another vehicle's, and as `send` does.
        """
        identity = message.identity
        if identity.source != self.vehicle:
            raise InputError(f"{identity} is not of vehicle {self.vehicle!r}")
        self._require_fitting(message.payload)
        channel = self._channel(identity.boot_id, message.schema_name)
        with self._mutex:
            self._require_open()
            self._spool.append(channel, identity.sequence, message.stamp_ns, message.payload)
        self._wake_up()

    def _channel(self, boot_id: str, schema_name: str) -> SpoolChannel:
        found = self._channels.get((boot_id, schema_name))
        if found is None:
            found = SpoolChannel(self.vehicle, boot_id, schema_name, numbered=boot_id == self.boot_id)
            self._channels[boot_id, schema_name] = found
        return found

    def _wake_up(self) -> None:
        if not self._unsynced.is_set():
            self._unsynced.set()

    def _require_open(self) -> None:
        if self._failure is not None:
            raise ServiceError(f"the publisher of {self.vehicle!r} has failed: {self._failure}") from self._failure
        if self._stop.is_set():
            raise ServiceError(f"the publisher of {self.vehicle!r} is closed")

    def _require_fitting(self, payload: bytes) -> None:
        limit = self._settings.message_limit_bytes
        if len(payload) > limit:
            raise EventRejected("too large", f"payload of {len(payload)} bytes, limit {limit}")

    @property
    def behind(self) -> Behind:
        """What is spooled and not acknowledged: how many messages, how many bytes, and how old the oldest is."""
        return self._spool.behind

    @property
    def sent(self) -> Sent:
        """What became of the messages so far."""
        return Sent(
            sent=self._forwarder.sent,
            resent=self._forwarder.resent,
            acknowledged=self._forwarder.acknowledged,
            dropped=self._spool.dropped,
            damaged_bytes=self._spool.damaged_bytes,
            sessions=self._link.sessions,
        )

    def flush(self, timeout_s: float) -> bool:
        """Whether everything sent so far is acknowledged, at once or within the time. Raises ServiceError if failed."""
        self._wake.set()
        with self._drained:
            done = self._drained.wait_for(lambda: self._spool.is_drained or self._failure is not None, timeout_s)
        if self._failure is not None:
            raise ServiceError(f"the publisher of {self.vehicle!r} has failed: {self._failure}") from self._failure
        return done

    def close(self) -> None:
        """What is not acknowledged stays in the spool, durable, for the next boot; again: no effect."""
        if self._stop.is_set():
            return
        atexit.unregister(self.close)
        self._stop.set()
        self._unsynced.set()
        self._wake.set()
        for thread in self._threads:
            thread.join(CLOSE_LONGEST_S)
        self._forwarder.leave()
        self._link.close()
        with self._mutex:
            self._spool.close()

    def _run(self, turn: Callable[[], None]) -> None:
        try:
            while not self._stop.is_set():
                turn()
        except Exception as error:  # carried to whoever sends next, and raised there
            self._failure = error
            logger.error("publisher of %s failed: %s", self.vehicle, error)
            with self._drained:
                self._drained.notify_all()

    def _sync(self) -> None:
        """One turn of the spool's thread: what is new becomes durable, whatever the bus is doing meanwhile."""
        self._unsynced.wait()
        self._unsynced.clear()
        self._spool.sync()
        self._wake.set()
        self._stop.wait(self._settings.sync_interval_s)

    def _turn(self) -> None:
        """One turn of the sending thread: what is durable is sent, and sent again."""
        if self._spool.is_drained:
            self._wake.wait(IDLE_S)
        self._wake.clear()
        try:
            self._require_bus()
            while self._forwarder.step(0.0) and not self._stop.is_set():
                pass
            self._forwarder.step(self._settings.sync_interval_s)
        except ServiceError as error:
            logger.warning("%s: %s; a new session follows", self.vehicle, error)
            self._forwarder.leave()
        if self._spool.is_drained:
            self._link.worked()
            with self._drained:
                self._drained.notify_all()

    def _require_bus(self) -> None:
        """A bus to send on, if one can be had: a new one after none, and after one that was silent for long."""
        if self._forwarder.is_on_bus and not self._link.is_worn(self._forwarder.silent_s()):
            return
        self._forwarder.leave()
        bus = self._link.opened()
        if bus is not None:
            self._forwarder.use(bus)
        else:
            self._stop.wait(self._settings.sync_interval_s)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

"""One vehicle's messages on their way to ingest: sent in order, sent again until they are acknowledged."""

import logging
import time
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from trigpoint.bus.ports import Bus, BusRun, Subscription
from trigpoint.events.codec import schema_version
from trigpoint.events.envelope import EventIdentity
from trigpoint.events.runs import EncodedRun
from trigpoint.events.uplink import acknowledgement_key, uplink_key
from trigpoint_vehicle.core.bridging import bridge
from trigpoint_vehicle.core.outgoing import Outgoing, SendChannel
from trigpoint_vehicle.core.patience import Patience, after_progress, after_sending, after_silence, patience
from trigpoint_vehicle.core.spool_walk import DESCRIPTION_SCHEMA
from trigpoint_vehicle.core.under_way import UnderWay
from trigpoint_vehicle.settings import VehicleSettings

LOOK_S = 0.05  # between two looks whether anybody listens
BRIDGE_AFTER_TRIES = 3  # some 7 s: until then an acknowledgement may just be an old one
TRUSTED_S = 5.0  # so long after an acknowledgement somebody listens, whatever the bus knows of it

UNKNOWN_VERSION = 1  # of a schema nobody here knows: its bytes go as they are

logger = logging.getLogger(__name__)


class Source(Protocol):
    """Where messages come from, and where it is told that they need not be kept."""

    def read(self, *, count: int, size_bytes: int) -> Sequence[Outgoing]:
        """The next messages in order, at most `count`, and as many until `size_bytes` are reached; none for now."""

    def released(self, count: int) -> None:
        """The oldest `count` that were read are acknowledged."""


class Forwarder:
    """Takes messages from a source through a window onto a bus. For one thread; it never calls the bus from another."""

    def __init__(
        self,
        source: Source,
        vehicle: str,
        settings: VehicleSettings,
        *,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._source, self._settings, self._now_s = source, settings, now_s
        self._listener_key = uplink_key(vehicle, None, root=settings.root)
        self._acknowledgement_key = acknowledgement_key(vehicle, root=settings.root)
        self._vehicle = vehicle
        self._bus: Bus | None = None
        self._acknowledgements: Subscription | None = None
        self._under_way: UnderWay = UnderWay(limit=settings.window_count, limit_bytes=settings.window_bytes)
        self._patience: Patience = patience(first_s=settings.ack_timeout_s, longest_s=settings.ack_timeout_max_s)
        self._heard_s = self._looked_s = -float("inf")
        self._is_heard = False
        self._said: EventIdentity | None = None  # the last acknowledgement heard
        self._bridged: EventIdentity | None = None  # up to where the receiver was told what is gone
        self._descriptions: dict[str, Outgoing] = {}
        self.sent = 0
        self.acknowledged = 0

    @property
    def resent(self) -> int:
        """How many messages were sent more than once, each time counted."""
        return self._under_way.resent

    @property
    def waiting(self) -> int:
        """How many messages were taken from the source and are not acknowledged."""
        return len(self._under_way)

    @property
    def is_on_bus(self) -> bool:
        """Whether it has a bus."""
        return self._bus is not None

    @property
    def tries_in_vain(self) -> int:
        """How often in a row sending again brought nothing."""
        return self._patience.tries

    @property
    def oldest(self) -> EventIdentity:
        """Whose acknowledgement is awaited. Raises IndexError if nothing is."""
        oldest = self._under_way.oldest
        return EventIdentity(oldest.channel.source, oldest.channel.boot_id, oldest.sequence)

    def silent_s(self) -> float:
        """How long something was awaited in vain."""
        return self._patience.silent_s(self._now_s())

    def use(self, bus: Bus) -> None:
        """From now on over this bus; what is under way is sent again. Raises ServiceError if it is closed."""
        self.leave()
        self._acknowledgements = bus.subscribe(self._acknowledgement_key)
        self._bus = bus
        self._is_heard = False
        self._patience = after_progress(self._patience, now_s=self._now_s(), more=self._under_way.awaiting > 0)
        self._looked_s = -float("inf")

    def leave(self) -> None:
        """Over no bus any more; nothing under way is forgotten."""
        if self._acknowledgements is not None:
            self._acknowledgements.close()
        self._acknowledgements = self._bus = None

    def step(self, wait_s: float) -> bool:
        """Whether something was sent, and so more may follow; waits up to `wait_s` for an acknowledgement first.

        Raises ServiceError if the bus is closed or the source cannot be read.
        """
        self._hear(wait_s)
        self._fill()
        if self._bus is None:
            return False
        now_s = self._now_s()
        self._look(self._bus, now_s)
        if self._patience.is_over(now_s):
            self._send_again(now_s)
            self._bridge(self._bus)
            return self._send(self._bus)
        if self._bridged is not None and self._bridged == self._said:
            self._bridge(self._bus)
        return self._may_send(now_s) and self._send(self._bus)

    def _hear(self, wait_s: float) -> None:
        if self._acknowledgements is None:
            return
        done = 0
        acknowledgement = self._acknowledgements.receive(wait_s)
        while acknowledgement is not None:
            if acknowledgement.identity.source == self._vehicle:
                self._heard_s = self._now_s()
                self._said = acknowledgement.identity
                done += self._under_way.accept(acknowledgement.identity)
            acknowledgement = self._acknowledgements.receive(0.0)
        if done:
            self.acknowledged += done
            self._source.released(done)
            self._patience = after_progress(self._patience, now_s=self._now_s(), more=self._under_way.awaiting > 0)

    def _fill(self) -> None:
        under_way = self._under_way
        count = min(under_way.room, self._settings.together_count)
        if count and not under_way.unsent:
            for message in self._source.read(count=count, size_bytes=under_way.room_bytes):
                under_way.add(message)
                if message.channel.schema_name == DESCRIPTION_SCHEMA:
                    self._descriptions.setdefault(message.channel.boot_id, message)

    def _look(self, bus: Bus, now_s: float) -> None:
        """Whether anybody listens; where somebody does again, what was sent meanwhile is sent again."""
        if now_s - self._looked_s < LOOK_S:
            return
        self._looked_s = now_s
        was_heard, self._is_heard = self._is_heard, bus.has_listener(self._listener_key)
        if self._is_heard and not was_heard and self._under_way.awaiting:
            self._patience = after_progress(self._patience, now_s=now_s, more=True)
            self._under_way.send_again()

    def _may_send(self, now_s: float) -> bool:
        return self._is_heard or now_s - self._heard_s < TRUSTED_S or self._patience.since_s is None

    def _send_again(self, now_s: float) -> None:
        self._patience = after_silence(self._patience, now_s=now_s)
        count = self._under_way.send_again()
        logger.info("%s: %d messages are sent again from %s", self._vehicle, count, self.oldest)

    def _bridge(self, bus: Bus) -> None:
        """What the receiver had acknowledged and has lost since is told to be gone, after enough tries in vain."""
        if self._patience.tries < BRIDGE_AFTER_TRIES or not self._under_way.awaiting:
            return
        missing = bridge(self._said, self._under_way.oldest, self._descriptions, key=self._listener_key)
        if missing:
            last = missing[-1]
            self._bridged = EventIdentity(last.channel.source, last.channel.boot_id, last.sequence)
            logger.error("%s: %s to %d were acknowledged and are missing now", self._vehicle, self._said, last.sequence)
            _publish(bus, missing)

    def _send(self, bus: Bus) -> bool:
        settings = self._settings
        messages = self._under_way.to_send(count=settings.together_count, size_bytes=settings.together_bytes)
        _publish(bus, messages)
        if messages:
            self.sent += len(messages)
            self._patience = after_sending(self._patience, now_s=self._now_s())
        return bool(messages)


def _publish(bus: Bus, messages: Sequence[Outgoing]) -> None:
    groups: dict[SendChannel, list[Outgoing]] = {}
    for message in messages:
        groups.setdefault(message.channel, []).append(message)
    for channel, group in groups.items():
        bus.publish_run(_run(channel, group))


def _run(channel: SendChannel, messages: Sequence[Outgoing]) -> BusRun:
    run = EncodedRun(
        source=channel.source,
        boot_id=channel.boot_id,
        schemas=(channel.schema_name,),
        schema_of_row=np.zeros(len(messages), dtype=np.int64),
        sequences=np.array([message.sequence for message in messages], dtype=np.int64),
        stamps_ns=np.array([message.stamp_ns for message in messages], dtype=np.int64),
        payloads=[message.payload for message in messages],
    )
    return BusRun(channel.key, schema_version(channel.schema_name) or UNKNOWN_VERSION, run)

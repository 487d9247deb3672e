"""A recorded drive sent over the bus as its vehicle would have: stored, forwarded, and sent again until it is kept."""

import logging
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from trigpoint.bus.event_messages import event_message
from trigpoint.bus.ports import Bus, BusMessage, Subscription
from trigpoint.errors import InputError, LogDamaged, ServiceError
from trigpoint.events.codec import event_class
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.keys import DEFAULT_ROOT
from trigpoint.events.observed import Observed
from trigpoint.events.uplink import acknowledgement_key, uplink_key
from trigpoint.logs.vehicle_log import RawMessage, read_vehicle_log

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplaySettings:
    """At most `window` messages are under way; all of them are sent again after `ack_timeout_s` without progress,
    `attempts` times. They are sent `together` at a time. Ingest has to appear within `listener_timeout_s`.
    """

    root: str = DEFAULT_ROOT
    window: int = 4096
    together: int = 256
    ack_timeout_s: float = 1.0
    attempts: int = 10
    listener_timeout_s: float = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayReport:
    """`messages` of the vehicle were all acknowledged; `resent` counts what had to be sent again."""

    vehicle: str
    messages: int
    resent: int


class _UnderWay:
    """One vehicle's messages under way: those sent and not yet acknowledged, oldest first."""

    def __init__(self, bus: Bus, acknowledgements: Subscription, settings: ReplaySettings) -> None:
        self._bus = bus
        self._acknowledgements = acknowledgements
        self._settings = settings
        self._unacknowledged: deque[BusMessage] = deque()
        self._gathered: list[BusMessage] = []
        self.sent = 0
        self.resent = 0

    def send(self, message: BusMessage) -> None:
        """The message sent, once there is room for it among those under way."""
        if len(self._unacknowledged) >= self._settings.window:
            self._send_gathered()
        while len(self._unacknowledged) >= self._settings.window:
            self._await_progress()
        self._unacknowledged.append(message)
        self._gathered.append(message)
        if len(self._gathered) >= self._settings.together:
            self._send_gathered()

    def _send_gathered(self) -> None:
        self._bus.publish_all(self._gathered)
        self.sent += len(self._gathered)
        self._gathered.clear()
        while acknowledgement := self._acknowledgements.receive(0.0):
            self._accept(acknowledgement.identity)

    def finish(self) -> None:
        """Every message is acknowledged."""
        self._send_gathered()
        while self._unacknowledged:
            self._await_progress()

    def _accept(self, acknowledged: EventIdentity) -> bool:
        """True if the acknowledgement was about something under way."""
        under_way = len(self._unacknowledged)
        while self._unacknowledged and _covers(acknowledged, self._unacknowledged[0].identity):
            self._unacknowledged.popleft()
        return len(self._unacknowledged) < under_way

    def _await_progress(self) -> None:
        for _ in range(self._settings.attempts):
            if self._progressed():
                return
            self._send_again()
        if self._progressed():
            return
        oldest = self._unacknowledged[0].identity
        raise ServiceError(
            f"{oldest}: {len(self._unacknowledged)} messages unacknowledged after {self._settings.attempts + 1} "
            f"times {self._settings.ack_timeout_s:g} s; what was acknowledged before is kept"
        )

    def _progressed(self) -> bool:
        deadline_s = time.monotonic() + self._settings.ack_timeout_s
        while (left_s := deadline_s - time.monotonic()) > 0.0:
            acknowledgement = self._acknowledgements.receive(left_s)
            if acknowledgement is not None and self._accept(acknowledgement.identity):
                return True
        return False

    def _send_again(self) -> None:
        logger.warning("%d messages sent again from %s", len(self._unacknowledged), self._unacknowledged[0].identity)
        self._bus.publish_all(tuple(self._unacknowledged))
        self.resent += len(self._unacknowledged)


def _covers(acknowledged: EventIdentity, sent: EventIdentity) -> bool:
    return acknowledged.boot_id == sent.boot_id and acknowledged.sequence >= sent.sequence


def replay_log(
    path: Path,
    bus: Bus,
    *,
    settings: ReplaySettings | None = None,
    progress: Callable[[int], None] | None = None,
) -> ReplayReport:
    """Every whole message of a vehicle's log sent as it is, all of them acknowledged; `progress` hears of each one.

    Raises LogDamaged, after the whole ones are acknowledged, for a damaged file, InputError for one without a message,
    ServiceError if nobody listens or acknowledges.
    """
    chosen = settings if settings is not None else ReplaySettings()
    return _replay(_recorded(read_vehicle_log(path), chosen.root), bus, chosen, progress)


def replay_rows(
    rows: Iterable[Envelope[Observed]],
    bus: Bus,
    *,
    settings: ReplaySettings | None = None,
    progress: Callable[[int], None] | None = None,
) -> ReplayReport:
    """One vehicle's events sent in order, all of them acknowledged; `progress` hears of each one.

    Raises InputError if there are none, ServiceError if nobody listens or acknowledges.
    """
    chosen = settings if settings is not None else ReplaySettings()
    return _replay(_encoded(rows, chosen.root), bus, chosen, progress)


def _replay(
    messages: Iterator[BusMessage], bus: Bus, settings: ReplaySettings, progress: Callable[[int], None] | None
) -> ReplayReport:
    first = next(messages, None)
    if first is None:
        raise InputError("no message to replay: a drive has at least its VehicleDescribed")
    vehicle = first.identity.source
    acknowledgements = bus.subscribe(acknowledgement_key(vehicle, root=settings.root))
    try:
        _require_listener(bus, first.key, settings.listener_timeout_s)
        under_way = _UnderWay(bus, acknowledgements, settings)
        try:
            for message in chain((first,), messages):
                under_way.send(message)
                if progress is not None:
                    progress(1)
        except LogDamaged:
            under_way.finish()
            raise
        under_way.finish()
    finally:
        acknowledgements.close()
    return ReplayReport(vehicle=vehicle, messages=under_way.sent, resent=under_way.resent)


def _recorded(messages: Iterable[RawMessage], root: str) -> Iterator[BusMessage]:
    for message in messages:
        yield BusMessage(
            key=uplink_key(message.identity.source, event_class(message.schema_name), root=root),
            schema_name=message.schema_name,
            payload=message.payload,
            identity=message.identity,
            stamp_ns=message.stamp_ns,
        )


def _encoded(rows: Iterable[Envelope[Observed]], root: str) -> Iterator[BusMessage]:
    for envelope in rows:
        yield event_message(envelope, key=uplink_key(envelope.identity.source, type(envelope.event), root=root))


def _require_listener(bus: Bus, key: str, timeout_s: float) -> None:
    if not bus.await_listener(key, timeout_s):
        raise ServiceError(f"nobody listens to {key} after {timeout_s:g} s: is ingest running?")

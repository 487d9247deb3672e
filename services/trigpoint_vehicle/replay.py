"""A recorded drive sent over the bus as its vehicle would have: in order, and again until all of it is acknowledged."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from trigpoint.bus.ports import Bus
from trigpoint.errors import InputError, LogDamaged, ServiceError
from trigpoint.events.codec import encode
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.keys import DEFAULT_ROOT
from trigpoint.events.observed import Observed
from trigpoint.logs.vehicle_log import read_vehicle_log
from trigpoint_vehicle.core.outgoing import Outgoing, SendChannel
from trigpoint_vehicle.forwarding import Forwarder
from trigpoint_vehicle.settings import VehicleSettings
from trigpoint_vehicle.spool_reading import send_channel

STEP_S = 0.05  # how long to wait for an acknowledgement before looking whether to send again
ACK_TIMEOUT_MIN_S = 1e-3
NUMBER_LIMIT = 2**63  # signed 64 bits

Numbered = tuple[str, bytes, EventIdentity, int]  # schema name, payload, identity, stamp in ns


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

    def sending(self) -> VehicleSettings:
        """The same as a vehicle's settings."""
        timeout_s = max(self.ack_timeout_s, ACK_TIMEOUT_MIN_S)
        return replace(
            VehicleSettings(root=self.root, window_count=self.window, together_count=self.together),
            ack_timeout_s=timeout_s,
            ack_timeout_max_s=timeout_s,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayReport:
    """`messages` of the vehicle were all acknowledged; `resent` counts what had to be sent again."""

    vehicle: str
    messages: int
    resent: int


class _Recorded:
    """The messages of a drive as a forwarder takes them; what ends them early is kept in `damage`."""

    def __init__(self, messages: Iterator[Numbered], *, root: str, progress: Callable[[int], None] | None) -> None:
        self._messages, self._root, self._progress = messages, root, progress
        self._channels: dict[tuple[str, str, str], SendChannel] = {}
        self._ahead: list[Outgoing] = []
        self.damage: LogDamaged | None = None
        self.is_over = False
        self.count = 0

    def first(self) -> Outgoing:
        """The message that will be read next. Raises InputError if there is none."""
        self._ahead += self._taken(1)
        if not self._ahead:
            raise self.damage or InputError("no message to replay: a drive has at least its VehicleDescribed")
        return self._ahead[0]

    def read(self, *, count: int, size_bytes: int) -> list[Outgoing]:
        """The next messages, at most `count`; a bundle of them may go over `size_bytes`."""
        ahead, self._ahead = self._ahead, []
        messages = ahead + self._taken(count - len(ahead))
        self.count += len(messages)
        if self._progress is not None and messages:
            self._progress(len(messages))
        return messages

    def released(self, count: int) -> None:
        """Nothing: the record keeps its messages."""

    def _taken(self, count: int) -> list[Outgoing]:
        taken: list[Outgoing] = []
        try:
            for numbered in islice(self._messages, count):
                taken.append(self._outgoing(numbered))
        except LogDamaged as error:
            self.damage = error
        self.is_over = self.is_over or len(taken) < count
        return taken

    def _outgoing(self, numbered: Numbered) -> Outgoing:
        schema_name, payload, identity, stamp_ns = numbered
        if not max(abs(identity.sequence), abs(stamp_ns)) < NUMBER_LIMIT:
            raise InputError(f"{identity} at {stamp_ns} ns: signed 64 bits are the limit")
        kind = identity.source, identity.boot_id, schema_name
        channel = self._channels.get(kind)
        if channel is None:
            channel = self._channels[kind] = send_channel(*kind, root=self._root)
        return Outgoing(channel, identity.sequence, stamp_ns, payload)


def replay_log(
    path: Path,
    bus: Bus,
    *,
    settings: ReplaySettings | None = None,
    progress: Callable[[int], None] | None = None,
) -> ReplayReport:
    """Every whole message of a vehicle's log sent as it is, all of them acknowledged; `progress` hears of them.

    Raises LogDamaged, after the whole ones are acknowledged, for a damaged file, InputError for one without a message,
    ServiceError if nobody listens or acknowledges.
    """
    messages = ((one.schema_name, one.payload, one.identity, one.stamp_ns) for one in read_vehicle_log(path))
    return _replay(messages, bus, settings if settings is not None else ReplaySettings(), progress)


def replay_rows(
    rows: Iterable[Envelope[Observed]],
    bus: Bus,
    *,
    settings: ReplaySettings | None = None,
    progress: Callable[[int], None] | None = None,
) -> ReplayReport:
    """One vehicle's events sent in order, all of them acknowledged; `progress` hears of them.

    Raises InputError if there are none, ServiceError if nobody listens or acknowledges.
    """
    messages = ((*encode(row.event), row.identity, row.stamp_ns) for row in rows)
    return _replay(messages, bus, settings if settings is not None else ReplaySettings(), progress)


def _replay(
    messages: Iterator[Numbered], bus: Bus, settings: ReplaySettings, progress: Callable[[int], None] | None
) -> ReplayReport:
    recorded = _Recorded(messages, root=settings.root, progress=progress)
    first = recorded.first()
    forwarder = Forwarder(recorded, first.channel.source, settings.sending())
    forwarder.use(bus)
    try:
        if not bus.await_listener(first.channel.key, settings.listener_timeout_s):
            raise ServiceError(
                f"nobody listens to {first.channel.key} after {settings.listener_timeout_s:g} s: is ingest running?"
            )
        _forward(forwarder, recorded, settings)
    finally:
        forwarder.leave()
    if recorded.damage is not None:
        raise recorded.damage
    return ReplayReport(vehicle=first.channel.source, messages=recorded.count, resent=forwarder.resent)


def _forward(forwarder: Forwarder, recorded: _Recorded, settings: ReplaySettings) -> None:
    wait_s = min(settings.ack_timeout_s, STEP_S)
    is_more = True
    while forwarder.waiting or not recorded.is_over:
        is_more = forwarder.step(0.0 if is_more else wait_s)
        if forwarder.tries_in_vain > settings.attempts:
            raise ServiceError(
                f"{forwarder.oldest}: {forwarder.waiting} messages unacknowledged after {forwarder.tries_in_vain} "
                f"times {settings.ack_timeout_s:g} s; what was acknowledged before is kept"
            )

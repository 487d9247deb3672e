"""A vehicle's logs sent by its publisher in recorded time, as the vehicle itself would have."""

import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from trigpoint.errors import AppendFailed, InputError, LogDamaged
from trigpoint.logs.vehicle_log import RawMessage, read_vehicle_log
from trigpoint_vehicle.core.tempo import Tempo, after_stamp
from trigpoint_vehicle.publisher import VehiclePublisher

FULL_RETRY_S = 0.1  # a full spool empties as ingest acknowledges

Progress = Callable[[int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Driven:
    """What came of a vehicle's logs: `messages` were spooled, `refused` could not be, and why the first of them was;
    `damage` is what of the logs could not be read. `is_acknowledged` where all the messages are.
    """

    messages: int
    refused: int
    refusal: str | None
    damage: str | None
    behind_max_messages: int
    is_acknowledged: bool


@dataclass(frozen=True, slots=True)
class VehicleLogs:
    """The logs of one vehicle, in the order given."""

    vehicle: str
    paths: tuple[Path, ...]


def logs_by_vehicle(paths: Sequence[Path]) -> tuple[VehicleLogs, ...]:
    """The logs sorted out by whose first message they hold. Raises InputError for one without any, LogDamaged."""
    found: dict[str, list[Path]] = {}
    for path in paths:
        if not path.is_file():
            raise InputError(f"{path}: no such file; an MCAP log of a vehicle is needed")
        first = next(read_vehicle_log(path), None)
        if first is None:
            raise InputError(f"{path}: no message to replay: a drive has at least its VehicleDescribed")
        found.setdefault(first.identity.source, []).append(path)
    return tuple(VehicleLogs(vehicle, tuple(own)) for vehicle, own in found.items())


class RecordedDrive:
    """Drives one publisher from logs until they end, everything is acknowledged, or `stop` is set."""

    def __init__(
        self, publisher: VehiclePublisher, *, speed: float, stop: threading.Event, progress: Progress | None = None
    ) -> None:
        self._publisher, self._stop, self._progress = publisher, stop, progress
        self._tempo = Tempo(speed=speed)
        self._began_s = time.monotonic()
        self._messages = self._refused = self._behind_max = 0
        self._refusal: str | None = None

    def run(self, paths: Iterable[Path], *, silence_limit_s: float) -> Driven:
        """What came of it; gives up after `silence_limit_s` without acknowledgement. Raises as the publisher does."""
        damages = []
        for path in paths:
            try:
                self._send_all(read_vehicle_log(path))
            except LogDamaged as error:
                damages.append(str(error))
        return Driven(
            messages=self._messages,
            refused=self._refused,
            refusal=self._refusal,
            damage="; ".join(damages) or None,
            is_acknowledged=self._await_acknowledgement(silence_limit_s),
            behind_max_messages=self._behind_max,
        )

    def _send_all(self, messages: Iterable[RawMessage]) -> None:
        for message in messages:
            self._tempo = after_stamp(self._tempo, message.stamp_ns)
            left_s = self._began_s + self._tempo.due_s - time.monotonic()
            if self._tempo.speed > 0.0 and left_s > 0.0:
                self._look()
                self._stop.wait(left_s)
            if self._stop.is_set():
                return
            self._send(message)

    def _send(self, message: RawMessage) -> None:
        while not self._stop.is_set():
            try:
                self._publisher.forward(message)
            except AppendFailed:
                self._look()
                self._stop.wait(FULL_RETRY_S)
                continue
            except InputError as error:
                self._refused += 1
                self._refusal = self._refusal or str(error)
                return
            self._messages += 1
            if self._progress is not None:
                self._progress(1)
            return

    def _look(self) -> None:
        self._behind_max = max(self._behind_max, self._publisher.behind.messages)

    def _await_acknowledgement(self, silence_limit_s: float) -> bool:
        self._look()
        acknowledged, since_s = self._publisher.sent.acknowledged, time.monotonic()
        while not self._stop.is_set() and time.monotonic() - since_s < silence_limit_s:
            if self._publisher.flush(min(1.0, silence_limit_s)):
                return True
            if self._publisher.sent.acknowledged > acknowledged:
                acknowledged, since_s = self._publisher.sent.acknowledged, time.monotonic()
        return self._publisher.flush(0.0)

"""Recorded drives sent into a running fleet, as fast as they were driven or so many times faster."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import cast

from command_runs.small_campus import write_small_campus
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.events.codec import decode
from trigpoint.events.envelope import Envelope
from trigpoint.events.observed import Observed, VehicleDescribed
from trigpoint.logs.vehicle_log import read_vehicle_log
from trigpoint_vehicle.replay import ReplaySettings, replay_rows

NS_PER_S = 1_000_000_000
BREAK_NS = 60 * NS_PER_S  # between two drives of a vehicle
PATIENT = ReplaySettings(together=16, ack_timeout_s=5.0, attempts=60, listener_timeout_s=60.0)

Rows = Sequence[Envelope[Observed]]


def small_campus_drives(folder: Path) -> list[Rows]:
    """The drives of a campus of a few streets, each as its vehicle numbered it."""
    return [read_rows(path) for path in write_small_campus(folder).logs]


def read_rows(path: Path) -> Rows:
    """The events of a vehicle's log."""
    return [
        Envelope(message.identity, message.stamp_ns, cast(Observed, decode(message.schema_name, message.payload)))
        for message in read_vehicle_log(path)
    ]


def span_ns(rows: Rows) -> tuple[int, int]:
    """The first and the last measurement of a drive; its description may be older."""
    stamps = [row.stamp_ns for row in rows if not isinstance(row.event, VehicleDescribed)]
    return min(stamps), max(stamps)


def first_part(rows: Rows, duration_s: float) -> Rows:
    """What was measured in the first so many seconds of a drive."""
    until_ns = span_ns(rows)[0] + round(duration_s * NS_PER_S)
    return [row for row in rows if row.stamp_ns <= until_ns]


def again(rows: Rows, times: int) -> Rows:
    """The same drive, driven again so many breaks later under a boot of its own."""
    first_ns, last_ns = span_ns(rows)
    later_ns = times * (last_ns - first_ns + BREAK_NS)
    return [
        replace(
            row,
            identity=replace(row.identity, boot_id=f"{row.identity.boot_id}-{times}"),
            stamp_ns=row.stamp_ns + later_ns,
        )  # fmt: skip
        for row in rows
    ]


def again_until(rows: Rows, enough: Callable[[int], bool]) -> Iterator[Rows]:
    """The same drive again and again, until so many times are enough."""
    for times in count():
        yield again(rows, times)
        if enough(times + 1):
            return


def paced(rows: Rows, speed: float, stop: threading.Event) -> Iterator[Envelope[Observed]]:
    """The rows at their own times from now on, `speed` times faster, until there is a reason to stop."""
    began_s, first_ns = time.monotonic(), span_ns(rows)[0]
    for row in rows:
        due_s = began_s + (row.stamp_ns - first_ns) / NS_PER_S / speed
        if stop.wait(max(due_s - time.monotonic(), 0.0)):
            return
        yield row


class Vehicle(threading.Thread):
    """One vehicle's drives sent, one after the other, until every event is acknowledged; `error` ended it early."""

    def __init__(self, drives: Iterator[Rows], endpoint: str, *, speed: float, stop: threading.Event) -> None:
        super().__init__(name="vehicle", daemon=True)
        self._drives, self._endpoint, self._speed, self._stop_driving = drives, endpoint, speed, stop
        self.error: Exception | None = None
        self.sent = self.rounds = 0

    def run(self) -> None:
        settings = ZenohSettings(mode="client", connect=(self._endpoint,), connect_timeout_s=30.0)
        try:
            with ZenohBus(settings) as bus:
                for rows in self._drives:
                    replay_rows(self._counted(rows), bus, settings=PATIENT)
                    self.rounds += 1
                    if self._stop_driving.is_set():
                        break
        except Exception as error:  # raised in the thread that waits for this one
            self.error = error

    def _counted(self, rows: Rows) -> Iterator[Envelope[Observed]]:
        for row in paced(rows, self._speed, self._stop_driving):
            self.sent += 1
            yield row


@contextmanager
def vehicles_on_the_road(
    drives: Sequence[Iterator[Rows]], endpoint: str, *, speed: float
) -> Iterator[Sequence[Vehicle]]:
    """A vehicle for each sequence of drives; they stop at the end. Raises what ended one early."""
    stop = threading.Event()
    vehicles = [Vehicle(one, endpoint, speed=speed, stop=stop) for one in drives]
    for vehicle in vehicles:
        vehicle.start()
    try:
        yield vehicles
    finally:
        stop.set()
        for vehicle in vehicles:
            vehicle.join()
    for vehicle in vehicles:
        if vehicle.error is not None:
            raise vehicle.error

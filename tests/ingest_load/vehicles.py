"""`python -m ingest_load.vehicles ENDPOINT`: vehicles that send prepared drives; one JSON object on standard output.

With acknowledgements each vehicle keeps a window under way, as a publisher does; without, the link alone holds it
back. At a pace, each message is due at its own time and handed over together with those due within the next 5 ms; the
time from when it is due to its acknowledgement is measured, whatever it waited for, these vehicles included: how late
they hand over is told beside it.
"""

import argparse
import gc
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from ingest_load.traffic import drive_runs, together_of
from trigpoint.bus.ports import BusRun, Subscription
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings

WINDOW_COUNT, WINDOW_BYTES = 8192, 16 * 1024 * 1024  # of a vehicle, as the publisher's
RESEND_S = 5.0
UNACKNOWLEDGED_LONGEST_S = 60.0  # until the receiver says that it has everything
PACED_TOGETHER_S = 0.005  # a publisher hands over what it has after an fsync, every 5 ms


@dataclass(slots=True)
class Vehicle:
    """One vehicle's drive: how far it is sent and acknowledged, in messages."""

    name: str
    runs: Sequence[BusRun]
    window: int
    next_run: int = 0
    sent: int = 0
    acknowledged: int = 0
    resent: int = 0
    progress_s: float = 0.0
    began_s: float = 0.0
    rate_hz: float | None = None  # of its messages, if it keeps to one
    awaited_s: list[float] = field(default_factory=list)  # since when, of each message sent
    late_s: list[float] = field(default_factory=list)  # of each run
    latencies_s: list[float] = field(default_factory=list)

    @property
    def has_more(self) -> bool:
        """Whether something was not sent yet."""
        return self.next_run < len(self.runs)

    @property
    def due_s(self) -> float:
        """When the next run is: with its last message. For a vehicle that keeps to a rate."""
        return self._due_s(self.sent + len(self.runs[self.next_run].run) - 1)

    def _due_s(self, sequence: int) -> float:
        assert self.rate_hz is not None
        return self.began_s + sequence / self.rate_hz

    def send(self, bus: ZenohBus) -> None:
        """The next run sent."""
        run, now_s = self.runs[self.next_run], time.monotonic()
        count = len(run.run)
        if self.sent == self.acknowledged:
            self.progress_s = now_s
        if self.rate_hz is None:
            self.awaited_s += [now_s] * count
        else:
            self.late_s.append(now_s - self.due_s)
            self.awaited_s += [self._due_s(sequence) for sequence in range(self.sent, self.sent + count)]
        self.next_run += 1
        self.sent += count
        bus.publish_run(run)

    def accept(self, sequence: int) -> None:
        """Everything up to this sequence is acknowledged."""
        now_s = time.monotonic()
        if sequence >= self.acknowledged:
            self.latencies_s += [now_s - at for at in self.awaited_s[self.acknowledged : sequence + 1]]
            self.acknowledged = sequence + 1
            self.progress_s = now_s

    def send_again(self, bus: ZenohBus) -> None:
        """Everything unacknowledged sent again, if it waited for long."""
        if self.sent == self.acknowledged or time.monotonic() - self.progress_s < RESEND_S:
            return
        for run in self.runs[: self.next_run]:
            if int(run.run.sequences[-1]) >= self.acknowledged:
                bus.publish_run(run)
                self.resent += len(run.run)
        self.progress_s = time.monotonic()


def send_all(fleet: Sequence[Vehicle], bus: ZenohBus, heard: Subscription) -> None:
    """Every drive sent and acknowledged, each through its window."""
    by_name = {vehicle.name: vehicle for vehicle in fleet}
    while any(vehicle.acknowledged < vehicle.sent or vehicle.has_more for vehicle in fleet):
        sent = False
        for vehicle in fleet:
            if vehicle.has_more and vehicle.sent - vehicle.acknowledged < vehicle.window:
                vehicle.send(bus)
                sent = True
            vehicle.send_again(bus)
        _hear(by_name, heard, 0.0 if sent else 0.01)


def send_at_pace(fleet: Sequence[Vehicle], bus: ZenohBus, heard: Subscription, rate_hz: float) -> None:
    """Every drive sent at `rate_hz` messages a second in all, the vehicles one behind the other, and acknowledged."""
    by_name = {vehicle.name: vehicle for vehicle in fleet}
    began_s = time.monotonic()
    for number, vehicle in enumerate(fleet):
        vehicle.rate_hz = rate_hz / len(fleet)
        vehicle.began_s = began_s + number / len(fleet) * PACED_TOGETHER_S
    while left := [vehicle for vehicle in fleet if vehicle.has_more]:
        vehicle = min(left, key=lambda one: one.due_s)
        while (left_s := vehicle.due_s - time.monotonic()) > 0.0:
            _hear(by_name, heard, left_s)
        vehicle.send(bus)
        vehicle.send_again(bus)
        _hear(by_name, heard, 0.0)
    while any(vehicle.acknowledged < vehicle.sent for vehicle in fleet):
        _hear(by_name, heard, 0.01)
        for vehicle in fleet:
            vehicle.send_again(bus)


def _turns(fleet: Sequence[Vehicle]) -> Iterator[Vehicle]:
    while any(vehicle.has_more for vehicle in fleet):
        yield from (vehicle for vehicle in fleet if vehicle.has_more)


def _hear(fleet: dict[str, Vehicle], heard: Subscription, timeout_s: float) -> None:
    message = heard.receive(timeout_s)
    while message is not None:
        fleet[message.identity.source].accept(message.identity.sequence)
        message = heard.receive(0.0)


def prepared(count: int, *, vehicles: int, size_bytes: int, together: int) -> list[Vehicle]:
    """Vehicles with drives of `count` messages each."""
    window = max(1, min(WINDOW_COUNT, WINDOW_BYTES // size_bytes))
    return [
        Vehicle(
            name,
            list(drive_runs(name, count=count, size_bytes=size_bytes, seed=seed, together=together)),
            window,
        )
        for seed, name in enumerate(f"veh-{index}" for index in range(vehicles))
    ]


def main(words: Sequence[str]) -> int:
    """Sends, and says how long it took."""
    parser = argparse.ArgumentParser()
    parser.add_argument("endpoint")
    parser.add_argument("--vehicles", type=int, default=10)
    parser.add_argument("--messages", type=int, required=True, help="of each vehicle")
    parser.add_argument("--bytes", type=int, required=True, help="of each payload")
    parser.add_argument("--unacknowledged", action="store_true")
    parser.add_argument("--rate", type=float, help="messages a second of all vehicles")
    options = parser.parse_args(words)
    together = together_of(options.bytes)
    if options.rate:
        together = max(1, min(together, round(options.rate / options.vehicles * PACED_TOGETHER_S)))
    fleet = prepared(options.messages, vehicles=options.vehicles, size_bytes=options.bytes, together=together)
    with ZenohBus(ZenohSettings(connect=(options.endpoint,))) as bus:
        heard = bus.subscribe("trigpoint/v1/ack/*")
        for vehicle in fleet:
            if not bus.await_listener(vehicle.runs[0].key, 30.0):
                raise SystemExit(f"nobody listens to {vehicle.runs[0].key}")
        gc.freeze()  # the drives are no garbage, and looking through them would delay what is measured
        began_s = time.monotonic()
        if options.rate:
            send_at_pace(fleet, bus, heard, options.rate)
        elif options.unacknowledged:
            for vehicle in _turns(fleet):
                vehicle.send(bus)
            heard.receive(UNACKNOWLEDGED_LONGEST_S)
        else:
            send_all(fleet, bus, heard)
        wall_s = time.monotonic() - began_s
    sys.stdout.write(json.dumps(_answer(fleet, wall_s)) + "\n")
    return 0


def _answer(fleet: Sequence[Vehicle], wall_s: float) -> dict[str, float]:
    latencies_s = [latency for vehicle in fleet for latency in vehicle.latencies_s] or [0.0]
    late_s = [late for vehicle in fleet for late in vehicle.late_s] or [0.0]
    count = sum(vehicle.sent for vehicle in fleet)
    return {
        "messages": count,
        "wall_s": wall_s,
        "messages_per_s": count / wall_s,
        "resent": sum(vehicle.resent for vehicle in fleet),
        "latency_p50_s": float(np.percentile(latencies_s, 50)),
        "latency_p99_s": float(np.percentile(latencies_s, 99)),
        "late_p99_s": float(np.percentile(late_s, 99)),
    }


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

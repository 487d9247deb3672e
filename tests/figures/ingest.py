"""Durable ingest against a bare Zenoh subscriber that writes MCAP: same vehicles, same traffic, same run.

Payloads are sweeps of landmarks filled up to the size: what vehicles may send that comes near a point cloud's 500 kB.
"""

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

from figures.figure import Bounds, Figure, Measurement, at_least, at_most
from figures.workbench import Workbench
from ingest_load.racing import VEHICLES, Race, Waited, median, raced, waited

SMALL_BYTES, SMALL_MESSAGES = 256, 30_000  # of each vehicle
LARGE_BYTES, LARGE_MESSAGES = 500_000, 120
RACES = 3
LATENCY_SHARE = 0.2
LATENCY_LIMIT_S = 0.05
LATENCY_RUN_S = 10.0
SHOWN = "python -m ingest_load.vehicles ENDPOINT --messages {messages} --bytes {size}  # to {receiver}"
RECEIVERS = "trigpoint serve ingest; python -m ingest_load.bare"


@cache
def races(folder: Path, size_bytes: int, messages: int) -> Sequence[Race]:
    """Several races, once a run."""
    return [
        raced(folder / f"race-{size_bytes}-{number}", messages=messages, size_bytes=size_bytes)
        for number in range(RACES)
    ]


def ratio(name: str, target: Bounds, *, size_bytes: int, messages: int) -> Figure:
    """The median of the races' ratios."""

    def measure(bench: Workbench) -> Measurement:
        value = median([race.ratio for race in races(bench.folder, size_bytes, messages)])
        return Measurement(value=value, command=_shown(size_bytes, messages, f"{RECEIVERS}, median of {RACES}"))

    return Figure(name=name, unit="1", target=target, measure=measure)


def rate(name: str, *, size_bytes: int, messages: int) -> Figure:
    """The median of ingest's rates."""

    def measure(bench: Workbench) -> Measurement:
        value = median([race.ingest_per_s for race in races(bench.folder, size_bytes, messages)])
        return Measurement(value=value, command=_shown(size_bytes, messages, "trigpoint serve ingest"))

    return Figure(name=name, unit="messages/s", target=None, measure=measure)


@cache
def _waited(folder: Path) -> tuple[Waited, str]:
    """How long messages waited at a fifth of the rate measured before, and the command; once a run."""
    rate_hz = LATENCY_SHARE * median([race.ingest_per_s for race in races(folder, SMALL_BYTES, SMALL_MESSAGES)])
    messages = round(rate_hz * LATENCY_RUN_S / VEHICLES)
    shown = f"{_shown(SMALL_BYTES, messages, 'trigpoint serve ingest')} --rate {rate_hz:.0f}"
    return waited(folder / "latency", messages=messages, size_bytes=SMALL_BYTES, rate_hz=rate_hz), shown


def of_waiting(name: str, value_of: Callable[[Waited], float], target: Bounds | None) -> Figure:
    """A time at a fifth of the rate."""

    def measure(bench: Workbench) -> Measurement:
        found, shown = _waited(bench.folder)
        return Measurement(value=value_of(found), command=shown)

    return Figure(name=f"{name} at {LATENCY_SHARE:.0%} of that rate, p99", unit="s", target=target, measure=measure)


def _shown(size_bytes: int, messages: int, receiver: str) -> str:
    return SHOWN.format(messages=messages, size=size_bytes, receiver=receiver)


FIGURES = (
    ratio(
        f"durable ingest over a bare subscriber, {SMALL_BYTES} B from {VEHICLES} vehicles",
        at_least(0.7),
        size_bytes=SMALL_BYTES,
        messages=SMALL_MESSAGES,
    ),
    rate(f"durable ingest, {SMALL_BYTES} B", size_bytes=SMALL_BYTES, messages=SMALL_MESSAGES),
    ratio(
        f"durable ingest over a bare subscriber, {LARGE_BYTES // 1000} kB",
        at_least(0.8),
        size_bytes=LARGE_BYTES,
        messages=LARGE_MESSAGES,
    ),
    rate(f"durable ingest, {LARGE_BYTES // 1000} kB", size_bytes=LARGE_BYTES, messages=LARGE_MESSAGES),
    of_waiting("acknowledgement", lambda one: one.p99_s, at_most(LATENCY_LIMIT_S)),
    of_waiting("of it until handed over by these vehicles", lambda one: one.late_p99_s, None),
)

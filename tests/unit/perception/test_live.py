"""Live perception: what a drive's sweeps hold is said as they come, each once, whatever is stopped in between."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scanned_worlds.casting import PERIOD_NS, START_NS
from scanned_worlds.drives import scanned_drive
from trigpoint.bus.memory_bus import MemoryBus, MemoryExchange
from trigpoint.events.codec import Event, encode
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import VehicleDescribed
from trigpoint.events.perceived import LandmarksPerceived
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.ports import LoggedEvent
from trigpoint.observability.metrics import Instruments
from trigpoint.workers import workers
from trigpoint_perception.app import STREAM, perceive_log
from trigpoint_perception.live import QUIET_S, LivePerception

COUNT = 9
ROWS = list(scanned_drive("van", COUNT))
CUT = 11  # events: five sweeps


class CountingLog(MemoryLog):
    """A log that counts the sweeps it gives out."""

    given = 0

    def read(self, stream: str, **wanted: Any) -> Iterator[LoggedEvent]:
        for row in super().read(stream, **wanted):
            self.given += isinstance(row.envelope.event, PointsScanned)
            yield row


class Clock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.s = 0.0

    def __call__(self) -> float:
        return self.s


def logged(rows: Sequence[Envelope[Event]]) -> CountingLog:
    log = CountingLog()
    log.append("veh-van", rows)
    return log


def said(log: MemoryLog) -> list[tuple[EventIdentity, int, bytes]]:
    rows = [row.envelope for row in log.read(STREAM)]
    return [(row.identity, row.stamp_ns, encode(row.event)[1]) for row in rows]


@pytest.fixture(scope="module")
def offline() -> list[tuple[EventIdentity, int, bytes]]:
    """What `trigpoint perceive` says of the drive."""
    log = logged(ROWS)
    with workers(threads=1) as some:
        perceive_log(log, lambda: log, some=some)
    return said(log)


def perceived(log: MemoryLog) -> list[LandmarksPerceived]:
    events = [row.envelope.event for row in log.read(STREAM)]
    return [event for event in events if isinstance(event, LandmarksPerceived)]


def sweeps_told(log: MemoryLog) -> list[int]:
    return [event.sweep_sequence for event in perceived(log)]


def all_taken(service: LivePerception) -> None:
    while service.step(0.0):
        pass


def followed(log: MemoryLog, checkpoint: Path | None = None, *, until_quiet: bool = True) -> Instruments:
    """Live perception of what the log has now; at its end the drive has been quiet for long, or has not."""
    clock, instruments = Clock(), Instruments("perception")
    with LivePerception(log, MemoryBus(), checkpoint=checkpoint, instruments=instruments, now_s=clock) as service:
        all_taken(service)
        clock.s = QUIET_S if until_quiet else 0.0
        all_taken(service)
    return instruments


def test_it_says_what_the_command_says_under_the_same_names(offline: list[Any]) -> None:
    log = logged(ROWS)
    followed(log)
    assert said(log) == offline


def test_sweeps_that_wait_for_later_ones_are_given_out_once_the_drive_is_quiet(offline: list[Any]) -> None:
    log = logged(ROWS)
    followed(log, until_quiet=False)
    assert 0 < len(said(log)) < len(offline)
    followed(log)
    assert said(log) == offline


def test_after_a_restart_it_goes_on_from_its_checkpoint(offline: list[Any], tmp_path: Path) -> None:
    log = logged(ROWS[:CUT])
    followed(log, tmp_path / "perception", until_quiet=False)
    log.append("veh-van", ROWS[CUT:])
    log.given = 0
    followed(log, tmp_path / "perception")
    assert log.given == COUNT - 5
    assert said(log) == offline


def test_a_drive_that_goes_on_after_it_was_quiet_has_each_sweep_said_once(offline: list[Any], tmp_path: Path) -> None:
    log = logged(ROWS[:CUT])
    followed(log, tmp_path / "perception")
    log.append("veh-van", ROWS[CUT:])
    followed(log, tmp_path / "perception")
    assert [identity for identity, _, _ in said(log)] == [identity for identity, _, _ in offline]
    assert sweeps_told(log) == [row.identity.sequence for row in ROWS if isinstance(row.event, PointsScanned)]


def test_without_its_checkpoint_it_looks_again_and_says_nothing_twice(offline: list[Any]) -> None:
    log = logged(ROWS[:CUT])
    followed(log, until_quiet=False)
    log.append("veh-van", ROWS[CUT:])
    followed(log)
    assert said(log) == offline


def test_what_was_killed_between_appending_and_its_checkpoint_says_nothing_twice(
    offline: list[Any], tmp_path: Path
) -> None:
    log = logged(ROWS[:CUT])
    followed(log, tmp_path / "perception", until_quiet=False)
    kept = (tmp_path / "perception").read_bytes()
    log.append("veh-van", ROWS[CUT:])
    followed(log, tmp_path / "perception", until_quiet=False)
    (tmp_path / "perception").write_bytes(kept)
    followed(log, tmp_path / "perception")
    assert said(log) == offline


def test_a_checkpoint_of_a_longer_log_is_not_gone_on_from(offline: list[Any], tmp_path: Path) -> None:
    followed(logged(ROWS), tmp_path / "perception")
    log = logged(ROWS[:CUT])
    followed(log, tmp_path / "perception", until_quiet=False)
    log.append("veh-van", ROWS[CUT:])
    followed(log, tmp_path / "perception")
    assert said(log) == offline


def test_a_drive_that_two_later_ones_followed_is_not_looked_at_again() -> None:
    log = logged(list(scanned_drive("van", 3, boot_id="boot-0")))
    for boot_id in ("boot-1", "boot-2"):
        log.append("veh-van", list(scanned_drive("van", 1, boot_id=boot_id)))
    followed(log)
    instruments = followed(log)
    assert instruments.registry.get_sample_value("trigpoint_sweep_seconds_count") == 2.0


def test_what_it_says_is_published_once_it_is_in_the_log() -> None:
    log, exchange = logged(ROWS), MemoryExchange()
    with MemoryBus(exchange) as bus, LivePerception(log, MemoryBus(exchange)) as service:
        inbox = bus.subscribe("trigpoint/v1/veh/van/perc/**")
        all_taken(service)
        heard = [message.key for message in iter(lambda: inbox.receive(0.0), None)]
    assert len(heard) == log.next_number(STREAM)
    assert set(heard) == {"trigpoint/v1/veh/van/perc/landmarks", "trigpoint/v1/veh/van/perc/odometry"}


def test_sweeps_are_counted_with_their_refusals_times_and_the_lag() -> None:
    empty = np.zeros((0, 3), dtype=np.float32)
    sweep = next(row.event for row in ROWS if isinstance(row.event, PointsScanned))
    broken = PointsScanned(
        sensor="roof",
        sensor_position_m=sweep.sensor_position_m,
        sensor_orientation=sweep.sensor_orientation,
        point_m=empty,
        intensity=np.zeros(0, dtype=np.float32),
        offset_ns=np.zeros(0, dtype=np.int32),
        ring=np.zeros(0, dtype=np.uint16),
    )
    log = logged([*ROWS, Envelope(EventIdentity("van", "boot-1", 99), START_NS + COUNT * PERIOD_NS, broken)])
    counted = followed(log).registry.get_sample_value
    refusal = perceived(log)[-1].refusal
    labels = {"vehicle": "van", "reason": refusal.partition(":")[0]}
    assert refusal
    assert counted("trigpoint_accepted_total", {"vehicle": "van"}) == COUNT
    assert counted("trigpoint_rejected_total", labels) == 1.0
    assert counted("trigpoint_sweep_seconds_count") == COUNT + 1
    assert counted("trigpoint_projection_lag_seconds") == 0.0


def test_a_drive_without_a_sweep_has_nothing_said_of_it() -> None:
    log = logged([Envelope(EventIdentity("van", "b", 0), START_NS, VehicleDescribed(vehicle="van"))])
    followed(log)
    assert log.next_number(STREAM) == 0

"""Live filtering goes on from its checkpoint: it reads only what came since, and says nothing twice."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from driven_paths.examples import Course, driven
from trigpoint.bus.memory_bus import MemoryBus
from trigpoint.events.codec import Event, encode
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.ports import LoggedEvent
from trigpoint_filtering.app import filter_log
from trigpoint_filtering.live import LiveFiltering
from unit.filtering.test_log_and_live import pinned_log, rows_of

ROWS = rows_of(driven(Course(duration_s=60.0)).drive)


class CountingLog(MemoryLog):
    """A log that counts the vehicles' events it gives out."""

    given = 0

    def read(self, stream: str, **wanted: Any) -> Iterator[LoggedEvent]:
        for row in super().read(stream, **wanted):
            self.given += stream.startswith("veh-")
            yield row


def counting(rows: list[Envelope[Event]]) -> CountingLog:
    log = CountingLog()
    log.append("map", [logged.envelope for logged in pinned_log().read("map")])
    log.append("veh-car", rows)
    return log


def said(log: MemoryLog) -> list[tuple[EventIdentity, int, bytes]]:
    rows = [logged.envelope for logged in log.read("filtering")]
    return [(row.identity, row.stamp_ns, encode(row.event)[1]) for row in rows]


def said_at_once() -> list[tuple[EventIdentity, int, bytes]]:
    whole = pinned_log(ROWS)
    filter_log(whole)
    return said(whole)


def followed(log: MemoryLog, checkpoint: Path) -> None:
    with LiveFiltering(log, MemoryBus(), checkpoint=checkpoint) as service:
        service.step(0.0)


def test_after_a_restart_only_what_came_since_the_checkpoint_is_read(tmp_path: Path) -> None:
    log = counting(ROWS[:600])
    followed(log, tmp_path / "filtering")
    log.append("veh-car", ROWS[600:])
    log.given = 0
    followed(log, tmp_path / "filtering")
    assert log.given == len(ROWS) - 600
    assert said(log) == said_at_once()


def test_estimates_appended_after_the_checkpoint_are_not_appended_again(tmp_path: Path) -> None:
    log, checkpoint = counting(ROWS[:600]), tmp_path / "filtering"
    followed(log, checkpoint)
    kept = checkpoint.read_bytes()
    log.append("veh-car", ROWS[600:900])
    followed(log, checkpoint)
    checkpoint.write_bytes(kept)  # as if the process had died before it wrote the second one
    log.append("veh-car", ROWS[900:])
    followed(log, checkpoint)
    assert said(log) == said_at_once()


def test_a_damaged_checkpoint_costs_only_reading_the_log_again(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    log, checkpoint = counting(ROWS[:600]), tmp_path / "filtering"
    followed(log, checkpoint)
    damaged = bytearray(checkpoint.read_bytes())
    damaged[200] ^= 1
    checkpoint.write_bytes(bytes(damaged))
    log.append("veh-car", ROWS[600:])
    followed(log, checkpoint)
    assert said(log) == said_at_once()
    assert "digest" in caplog.text

"""Clouds of points stand among a vehicle's other events, and cost nothing to those who do not ask for them."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from event_examples.any_event import same_event
from event_examples.one_each import EVENTS
from event_examples.rows import START_NS, STEP_NS, imu_row
from trigpoint.errors import EventRejected, InputError, LogDamaged
from trigpoint.events.codec import Event, schema_name
from trigpoint.events.drives import DRIVE_KINDS
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import ImuMeasured
from trigpoint.events.runs import EncodedRun
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.as_of import LogAsOf
from trigpoint.logs.following import StreamFollower
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.mcap_writer import CHUNK_BYTES
from trigpoint.logs.readings import drives_of_vehicle, logged_drives

HUGE_BYTES = 3_000_000  # a sweep of 64 lasers
RUBBISH = np.random.default_rng(1).bytes(HUGE_BYTES)  # which no decoder takes for a cloud


def rubbish_cloud(sequence: int) -> EncodedRun:
    return EncodedRun(
        source="van",
        boot_id="boot-1",
        schemas=(schema_name(PointsScanned),),
        schema_of_row=np.zeros(1, dtype=np.int64),
        sequences=np.array([sequence]),
        stamps_ns=np.array([START_NS + sequence * STEP_NS]),
        payloads=[RUBBISH],
    )


@pytest.fixture
def log(tmp_path: Path) -> Iterator[McapLog]:
    """Two IMU samples, a cloud that cannot be decoded, two IMU samples, and such a cloud at the end."""
    with closing(McapLog(tmp_path / "log")) as opened:
        rows: list[Envelope[Event] | EncodedRun] = [
            imu_row(0),
            imu_row(1),
            rubbish_cloud(2),
            imu_row(3),
            imu_row(4),
            rubbish_cloud(5),
        ]
        opened.append("veh-van", rows)
        yield opened


def test_the_cloud_is_there_and_cannot_be_decoded(log: McapLog) -> None:
    with pytest.raises(EventRejected, match="undecodable"):
        list(log.read("veh-van", kinds=(PointsScanned,)))


def test_the_drives_of_a_log_are_read_without_its_clouds(log: McapLog) -> None:
    (drive,) = logged_drives(log)
    assert drive.imu.yaw_rate_radps.tolist() == [0.0, 0.01, 0.03, 0.04]


def test_a_vehicles_drives_are_read_without_its_clouds(log: McapLog) -> None:
    (drive,) = drives_of_vehicle(log, "van")
    assert len(drive.imu.stamp_ns) == 4


def test_an_earlier_state_of_the_log_is_looked_at_without_its_clouds(log: McapLog) -> None:
    assert [boot.boot_id for boot in LogAsOf(log, (("veh-van", 4),)).boots("veh-van")] == ["boot-1"]


def test_a_large_cloud_has_a_chunk_of_its_own_which_nobody_else_unpacks(log: McapLog) -> None:
    before = log.read_counts.chunks
    assert len(list(log.read("veh-van", kinds=DRIVE_KINDS))) == 4
    assert log.read_counts.chunks - before == 2
    assert HUGE_BYTES > CHUNK_BYTES


def test_a_cloud_damaged_on_the_disk_costs_the_drives_nothing(log: McapLog) -> None:
    (path,) = log.directory.glob("veh-van/*.mcap")
    content = bytearray(path.read_bytes())
    content[content.index(RUBBISH[:64]) + 1000] ^= 0xFF  # random bytes do not compress: they stand there as they are
    path.write_bytes(bytes(content))
    assert len(logged_drives(log)[0].imu.stamp_ns) == 4
    with pytest.raises(LogDamaged):
        list(log.read("veh-van"))


def test_who_follows_a_stream_passes_over_its_clouds_and_is_not_behind(log: McapLog) -> None:
    follower = StreamFollower(log, ["veh-van"], kinds=DRIVE_KINDS)
    taken = [row.position.number for _ in range(3) for row in follower.take(2)]
    assert taken == [0, 1, 3, 4]
    assert (dict(follower.checkpoint), follower.lag) == ({"veh-van": 6}, 0)


def test_who_goes_on_from_a_checkpoint_misses_nothing_behind_a_cloud(log: McapLog) -> None:
    first = StreamFollower(log, ["veh-van"], kinds=DRIVE_KINDS)
    first.take(2)
    second = StreamFollower(log, ["veh-van"], checkpoint=first.checkpoint, kinds=DRIVE_KINDS)
    assert [row.position.number for row in second.take(9)] == [3, 4]


def test_runs_of_other_kinds_are_read_without_unpacking_a_cloud(log: McapLog) -> None:
    runs = list(log.read_runs("veh-van", kinds=(ImuMeasured,)))
    assert [(row.position.number, len(row.run)) for row in runs] == [(0, 2), (3, 2)]


def test_a_log_of_points_alone_makes_no_drive_and_says_so(tmp_path: Path) -> None:
    with closing(McapLog(tmp_path / "log")) as log:
        log.append("veh-van", [rubbish_cloud(0)])
        with pytest.raises(InputError, match="none of the log's 1 events of vehicles tells of a path"):
            logged_drives(log)


def test_a_sweep_is_read_back_exactly(tmp_path: Path) -> None:
    sweep: Event = next(event for event in EVENTS if isinstance(event, PointsScanned))
    with closing(McapLog(tmp_path / "log")) as log:
        log.append("veh-van", [Envelope(EventIdentity("van", "boot-1", 0), START_NS, sweep)])
        (row,) = log.read("veh-van")
    assert same_event(row.envelope.event, sweep)

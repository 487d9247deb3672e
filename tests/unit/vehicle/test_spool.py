"""A vehicle's spool gives back what was put in, in order, whatever happened to its process, its disk or its files."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import count
from pathlib import Path

import pytest

from trigpoint.errors import AppendFailed, InputError
from trigpoint.events.codec import schema_name
from trigpoint.events.observed import ImuMeasured, VehicleDescribed
from trigpoint.events.uplink import DROPPED_SCHEMA
from trigpoint_vehicle.core.outgoing import Outgoing
from trigpoint_vehicle.core.spool_records import HEAD_BYTES, SpoolChannel
from trigpoint_vehicle.settings import VehicleSettings
from trigpoint_vehicle.spool import Spool

SMALL = VehicleSettings(segment_bytes=4096, spool_limit_bytes=40_960)
DROPPING = replace(SMALL, when_full="drop oldest")
PAYLOAD = b"x" * 500
DESCRIPTION = schema_name(VehicleDescribed)
IMU = schema_name(ImuMeasured)


@contextmanager
def spool(
    folder: Path, boot: str = "boot-1", settings: VehicleSettings = SMALL, *, now_ns: Callable[[], int] = lambda: 1
) -> Iterator[Spool]:
    opened = Spool(folder, "veh-a", boot, settings, now_ns=now_ns)
    try:
        yield opened
    finally:
        opened.close()


def fill(spool: Spool, numbers: range, *, boot: str = "boot-1", payload: bytes = PAYLOAD) -> None:
    """A description under number 0, measurements under all others."""
    channels = {name: SpoolChannel("veh-a", boot, name, True) for name in (DESCRIPTION, IMU)}
    for number in numbers:
        spool.append(channels[IMU if number else DESCRIPTION], number, 10 * number, payload)


def everything(spool: Spool) -> list[Outgoing]:
    spool.sync()
    messages = []
    while some := spool.read(count=7, size_bytes=10**9):
        messages += some
    return messages


def numbers(spool: Spool) -> list[tuple[str, int]]:
    return [(one.channel.boot_id, one.sequence) for one in everything(spool)]


def cut_off(path: Path, cut_bytes: int) -> None:
    """The file as a crash leaves it: without its seal, and without the end of its last message."""
    path.write_bytes(path.read_bytes()[: -HEAD_BYTES - cut_bytes])


def segments(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.spool"))


def test_what_went_in_comes_out_in_order_with_all_it_had(tmp_path: Path) -> None:
    with spool(tmp_path) as one:
        fill(one, range(30))
        messages = everything(one)
    assert [(message.sequence, message.stamp_ns, message.payload) for message in messages] == [
        (number, 10 * number, PAYLOAD) for number in range(30)
    ]
    assert [message.channel.key for message in messages[:2]] == [
        "trigpoint/v1/veh/veh-a/up/description",
        "trigpoint/v1/veh/veh-a/up/imu",
    ]


def test_nothing_is_read_before_it_is_durable(tmp_path: Path) -> None:
    with spool(tmp_path) as one:
        fill(one, range(3))
        assert one.read(count=10, size_bytes=10**9) == []
        one.sync()
        assert len(one.read(count=10, size_bytes=10**9)) == 3


def test_an_older_boot_s_messages_come_first_and_under_its_name(tmp_path: Path) -> None:
    with spool(tmp_path, "boot-1") as first:
        fill(first, range(3), boot="boot-1")
    with spool(tmp_path, "boot-2") as second:
        fill(second, range(2), boot="boot-2")
        assert numbers(second) == [("boot-1", 0), ("boot-1", 1), ("boot-1", 2), ("boot-2", 0), ("boot-2", 1)]


def test_a_segment_goes_when_all_of_it_is_released_and_not_before(tmp_path: Path) -> None:
    with spool(tmp_path) as one:
        fill(one, range(20))
        assert len(everything(one)) == 20
        before = segments(tmp_path)
        one.released(before[0].read_bytes().count(PAYLOAD) - 1)
        assert segments(tmp_path) == before
        one.released(1)
        assert segments(tmp_path) == before[1:]


def test_a_spool_closed_with_everything_released_leaves_no_segment(tmp_path: Path) -> None:
    with spool(tmp_path) as one:
        fill(one, range(20))
        one.released(len(everything(one)))
        assert one.is_drained
    assert segments(tmp_path) == []


def test_behind_counts_messages_and_bytes_and_tells_the_oldest_one_s_age(tmp_path: Path) -> None:
    seconds = count(100)
    with spool(tmp_path, now_ns=lambda: next(seconds) * 10**9) as one:
        fill(one, range(4))  # at 100 to 103 s
        everything(one)
        one.released(1)
        behind = one.behind  # at 104 s
    assert (behind.messages, behind.bytes, behind.oldest_s) == (3, 1500, 3.0)


def test_what_is_behind_is_known_again_after_a_restart(tmp_path: Path) -> None:
    with spool(tmp_path) as one:
        fill(one, range(20))
    with spool(tmp_path, "boot-2") as again:
        assert (again.behind.messages, again.behind.bytes) == (20, 20 * 500)


@pytest.mark.parametrize("cut_bytes", [1, 35, 36, 300, 535])
def test_a_torn_tail_is_cut_and_what_is_whole_before_it_stays(tmp_path: Path, cut_bytes: int) -> None:
    with spool(tmp_path) as one:
        fill(one, range(3))
    (path,) = segments(tmp_path)
    cut_off(path, cut_bytes)
    with spool(tmp_path, "boot-2") as again:
        assert numbers(again) == [("boot-1", 0), ("boot-1", 1)]


def test_a_segment_that_was_not_closed_is_read_through_and_counted(tmp_path: Path) -> None:
    with spool(tmp_path) as one:
        fill(one, range(3))
    cut_off(segments(tmp_path)[0], 0)
    with spool(tmp_path, "boot-2") as again:
        assert (again.behind.messages, again.behind.bytes) == (3, 1500)


def test_a_damaged_message_is_told_of_under_its_number_and_the_others_stay(tmp_path: Path) -> None:
    with spool(tmp_path) as one:
        fill(one, range(4))
    (path,) = segments(tmp_path)
    data = bytearray(path.read_bytes())
    data[data.find(PAYLOAD, data.find(PAYLOAD) + 600) + 10] ^= 1
    path.write_bytes(data)
    with spool(tmp_path, "boot-2") as again:
        messages = everything(again)
        again.released(len(messages))
        assert again.is_drained
        assert again.damaged_bytes == 536
    assert [message.sequence for message in messages] == [0, 1, 2, 3]
    assert [message.sequence for message in messages if message.channel.schema_name == DROPPED_SCHEMA] == [1]


def test_a_file_with_no_whole_record_is_kept_aside(tmp_path: Path) -> None:
    (tmp_path / "000000000000.spool").write_bytes(b"something else entirely")
    with spool(tmp_path) as one:
        assert numbers(one) == []
    assert (tmp_path / "000000000000.damaged").read_bytes() == b"something else entirely"


def test_a_folder_has_one_publisher(tmp_path: Path) -> None:
    with spool(tmp_path), pytest.raises(InputError, match="another publisher has this spool"):
        Spool(tmp_path, "veh-a", "boot-2", SMALL)


def test_another_vehicle_s_spool_is_refused_with_both_names(tmp_path: Path) -> None:
    with spool(tmp_path) as one:
        fill(one, range(2))
    with pytest.raises(InputError, match=r"'veh-a', not of 'veh-b'"):
        Spool(tmp_path, "veh-b", "boot-2", SMALL)


def test_a_refused_spool_can_be_opened_by_its_own_vehicle(tmp_path: Path) -> None:
    with spool(tmp_path) as one:
        fill(one, range(2))
    with pytest.raises(InputError):
        Spool(tmp_path, "veh-b", "boot-2", SMALL)
    with spool(tmp_path, "boot-3") as again:
        assert len(everything(again)) == 2


def test_a_full_spool_refuses_with_the_limit_and_takes_more_once_there_is_room(tmp_path: Path) -> None:
    with spool(tmp_path) as one:
        with pytest.raises(AppendFailed, match=r"'veh-a' holds \d+ bytes, limit 40960"):
            fill(one, range(1000))
        held = one.behind.messages
        one.released(len(everything(one)))
        fill(one, range(held, held + 3))
        assert [message.sequence for message in everything(one)] == [held, held + 1, held + 2]


def test_a_full_spool_drops_the_oldest_data_and_never_a_description(tmp_path: Path) -> None:
    with spool(tmp_path, settings=DROPPING) as one:
        fill(one, range(400))
        assert sum(path.stat().st_size for path in segments(tmp_path)) <= DROPPING.spool_limit_bytes
        dropped, behind = one.dropped, one.behind
        messages = everything(one)
        one.released(len(messages))
        assert one.is_drained
    assert dropped + behind.messages == 400
    assert [message.sequence for message in messages] == list(range(400))
    gone = [message.sequence for message in messages if message.channel.schema_name == DROPPED_SCHEMA]
    assert gone == list(range(1, dropped + 1))
    assert messages[0].payload == PAYLOAD


def test_what_was_dropped_is_known_after_a_restart(tmp_path: Path) -> None:
    with spool(tmp_path, settings=DROPPING) as one:
        fill(one, range(400))
        dropped = one.dropped
    with spool(tmp_path, "boot-2", DROPPING) as again:
        messages = everything(again)
    assert [message.sequence for message in messages] == list(range(400))
    assert sum(not message.is_data for message in messages) == dropped


def test_what_is_being_read_is_not_dropped(tmp_path: Path) -> None:
    with spool(tmp_path, settings=DROPPING) as one:
        fill(one, range(20))
        one.sync()
        begun = one.read(count=2, size_bytes=10**9)
        fill(one, range(20, 400))
        rest = everything(one)
    assert [message.sequence for message in (*begun, *rest)] == list(range(400))
    assert all(message.is_data for message in (*begun, *rest[:2]))


def test_a_disk_that_takes_half_a_record_leaves_no_trace_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = os.write
    with spool(tmp_path) as one:
        fill(one, range(2))
        with monkeypatch.context() as full:
            full.setattr(os, "write", lambda handle, data: write(handle, data[: len(data) // 2]))
            with pytest.raises(AppendFailed, match="the disk is full"):
                fill(one, range(2, 3))
        fill(one, range(2, 4))
        assert [message.sequence for message in everything(one)] == [0, 1, 2, 3]
    with spool(tmp_path, "boot-2") as again:
        assert len(everything(again)) == 4

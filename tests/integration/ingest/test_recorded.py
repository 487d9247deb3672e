"""Whole vehicle logs, sound and broken, end in the log: each event once, nothing else lost, faults named."""

import math
import random
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from trigpoint.errors import InputError
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import EventRefused, GnssFixReceived, MapFramePinned, Observed, VehicleDescribed
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.vehicle_log import write_vehicle_log
from trigpoint_ingest.core.tally import IngestReport
from trigpoint_ingest.recorded import ingest_logs
from trigpoint_ingest.settings import IngestSettings

Rows = list[Envelope[Observed]]
HOUR_NS = 3_600_000_000_000


def stored(log: McapLog, vehicle: str = "veh-a") -> list[Envelope[object]]:
    return [row.envelope for row in log.read(f"veh-{vehicle}")]


def refused(log: McapLog) -> list[EventRefused]:
    events = [row.envelope.event for row in log.read("refused")]
    return [event for event in events if isinstance(event, EventRefused)]


def ingested(tmp_path: Path, rows: Rows, log: McapLog) -> IngestReport:
    path = tmp_path / "changed.mcap"
    write_vehicle_log(path, rows, vehicle="veh-a")
    return ingest_logs([path], log)


def with_fix(rows: Rows, index: int, **changed: float) -> Rows:
    """The rows with one fix changed."""
    event = rows[index].event
    assert isinstance(event, GnssFixReceived)
    return [*rows[:index], replace(rows[index], event=replace(event, **changed)), *rows[index + 1 :]]


def test_a_sound_log_is_taken_whole_and_in_order(vehicle_log: Path, rows: Rows, log: McapLog) -> None:
    report = ingest_logs([vehicle_log], log)
    assert stored(log) == rows
    assert (report.accepted, report.duplicates, report.refused, report.complaints()) == (3000, 0, (), ())


def test_the_same_log_again_changes_nothing(vehicle_log: Path, rows: Rows, log: McapLog) -> None:
    ingest_logs([vehicle_log], log)
    report = ingest_logs([vehicle_log], log)
    assert (report.accepted, report.duplicates) == (0, 3000)
    assert stored(log) == rows


def test_the_same_log_again_after_a_restart_changes_nothing(vehicle_log: Path, rows: Rows, tmp_path: Path) -> None:
    first = McapLog(tmp_path / "log")
    ingest_logs([vehicle_log], first)
    first.close()
    second = McapLog(tmp_path / "log")
    assert ingest_logs([vehicle_log], second).duplicates == 3000
    assert stored(second) == rows
    second.close()


def test_a_log_longer_than_the_one_before_adds_what_is_new(vehicle_log: Path, rows: Rows, log: McapLog) -> None:
    write_vehicle_log(vehicle_log, rows[:1000], vehicle="veh-a")
    ingest_logs([vehicle_log], log)
    write_vehicle_log(vehicle_log, rows, vehicle="veh-a")
    report = ingest_logs([vehicle_log], log)
    assert (report.accepted, report.duplicates) == (2000, 1000)
    assert stored(log) == rows


def test_two_vehicles_are_counted_and_kept_apart(vehicle_log: Path, rows: Rows, log: McapLog, tmp_path: Path) -> None:
    other = [replace(row, identity=replace(row.identity, source="veh-b")) for row in rows[1:500]]
    described = Envelope(EventIdentity("veh-b", "boot-1", 0), rows[0].stamp_ns, VehicleDescribed(vehicle="veh-b"))
    write_vehicle_log(tmp_path / "veh-b.mcap", [described, *other], vehicle="veh-b")
    report = ingest_logs([vehicle_log, tmp_path / "veh-b.mcap"], log)
    assert [(counts.vehicle, counts.accepted) for counts in report.vehicles] == [("veh-a", 3000), ("veh-b", 500)]
    assert stored(log, "veh-b") == [described, *other]


def test_the_first_fix_pins_the_frame_and_no_later_log_moves_it(
    vehicle_log: Path, rows: Rows, log: McapLog, tmp_path: Path
) -> None:
    ingest_logs([vehicle_log], log)
    paris = [replace(row, identity=replace(row.identity, boot_id="boot-2")) for row in rows[:20]]
    ingested(tmp_path, with_fix(paris, 10, lat_deg=48.85, lon_deg=2.35), log)
    frames = [row.envelope.event for row in log.read("map")]
    assert frames == [
        MapFramePinned(
            crs="EPSG:32756", origin_easting_m=333_000.0, origin_northing_m=6_248_000.0, declared_by="first fix"
        )
    ]


def test_a_declared_origin_pins_the_frame_before_any_fix(rows: Rows, log: McapLog, tmp_path: Path) -> None:
    described = VehicleDescribed(
        vehicle="veh-a", declared_crs="EPSG:32756", declared_origin_easting_m=1.0, declared_origin_northing_m=2.0
    )
    ingested(tmp_path, [replace(rows[0], event=described), *rows[1:]], log)
    (frame,) = [row.envelope.event for row in log.read("map")]
    assert isinstance(frame, MapFramePinned)
    assert (frame.declared_by, frame.origin_easting_m) == ("declared origin", 1.0)


def test_an_invalid_fix_does_not_pin_the_frame(rows: Rows, log: McapLog, tmp_path: Path) -> None:
    ingested(tmp_path, with_fix(rows[:15], 10, lat_deg=91.0), log)
    assert "map" not in log.streams()


def test_progress_adds_up_to_all_messages(vehicle_log: Path, log: McapLog) -> None:
    heard: list[int] = []
    ingest_logs([vehicle_log], log, progress=heard.append)
    assert sum(heard) == 3000


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"lat_deg": 91.0}, "out of range"),
        ({"lat_deg": math.nan}, "not finite"),
        ({"lon_deg": math.inf}, "not finite"),
        ({"sigma_m": -1.0}, "out of range"),
    ],
)
def test_a_bad_fix_is_kept_aside_and_all_else_goes_in(
    changed: dict[str, float], reason: str, rows: Rows, log: McapLog, tmp_path: Path
) -> None:
    report = ingested(tmp_path, with_fix(rows, 1000, **changed), log)
    assert report.refused == ((reason, 1),)
    assert stored(log) == [*rows[:1000], *rows[1001:]]
    assert [(event.source, event.reason) for event in refused(log)] == [("veh-a", reason)]


def test_a_refusal_is_kept_once_however_often_the_log_comes(rows: Rows, log: McapLog, tmp_path: Path) -> None:
    bad = with_fix(rows[:50], 20, lat_deg=91.0)
    ingested(tmp_path, bad, log)
    report = ingested(tmp_path, bad, log)
    assert report.refused == (("out of range", 1),)
    assert len(refused(log)) == 1


def test_a_mended_message_goes_in_after_its_refusal(rows: Rows, log: McapLog, tmp_path: Path) -> None:
    ingested(tmp_path, with_fix(rows[:50], 20, lat_deg=91.0), log)
    assert ingested(tmp_path, rows[:50], log).accepted == 1


def test_time_going_back_an_hour_is_refused_and_the_rest_goes_in(rows: Rows, log: McapLog, tmp_path: Path) -> None:
    back = [*rows[:1000], replace(rows[1000], stamp_ns=rows[1000].stamp_ns - HOUR_NS), *rows[1001:]]
    assert ingested(tmp_path, back, log).refused == (("time backwards", 1),)
    assert stored(log) == [*rows[:1000], *rows[1001:]]


def test_time_jumping_ahead_an_hour_does_not_refuse_what_follows(rows: Rows, log: McapLog, tmp_path: Path) -> None:
    ahead = [*rows[:1000], replace(rows[1000], stamp_ns=rows[1000].stamp_ns + HOUR_NS), *rows[1001:]]
    assert ingested(tmp_path, ahead, log).refused == (("time jumped", 1),)
    assert stored(log) == [*rows[:1000], *rows[1001:]]


def test_a_log_without_description_is_of_an_unknown_vehicle(rows: Rows, log: McapLog, tmp_path: Path) -> None:
    report = ingested(tmp_path, rows[1:11], log)
    assert report.refused == (("unknown vehicle", 10),)
    assert report.complaints() == ("vehicle 'veh-a': 10 messages refused, unknown vehicle",)
    assert len(refused(log)) == 10


def test_another_vehicles_message_in_a_log_is_of_an_unknown_vehicle(rows: Rows, log: McapLog, tmp_path: Path) -> None:
    stray = replace(rows[7], identity=EventIdentity("veh-x", "boot-1", 7))
    report = ingested(tmp_path, [*rows[:20], stray], log)
    assert report.refused == (("unknown vehicle", 1),)
    assert stored(log) == rows[:20]


def test_a_vehicle_outside_the_fleet_is_unknown(vehicle_log: Path, log: McapLog) -> None:
    report = ingest_logs([vehicle_log], log, settings=IngestSettings(fleet=frozenset({"veh-b"})))
    assert report.refused == (("unknown vehicle", 3000),)


def test_a_description_with_an_unknown_crs_is_named(rows: Rows, log: McapLog, tmp_path: Path) -> None:
    described = VehicleDescribed(vehicle="veh-a", declared_crs="EPSG:99999")
    report = ingested(tmp_path, [replace(rows[0], event=described), *rows[1:5]], log)
    assert report.refused == (("unknown crs", 1), ("unknown vehicle", 4))
    assert "EPSG:99999" in refused(log)[0].detail


def test_duplicates_in_a_log_go_in_once(rows: Rows, log: McapLog, tmp_path: Path) -> None:
    doubled = [row for row in rows for _ in range(2)]
    report = ingested(tmp_path, doubled, log)
    assert (report.accepted, report.duplicates) == (3000, 3000)
    assert stored(log) == rows


def test_reordered_messages_all_go_in(rows: Rows, log: McapLog, tmp_path: Path) -> None:
    shuffled = rows[:900]  # 9 s: within the tolerance of 10 s
    random.Random(4).shuffle(shuffled)
    assert ingested(tmp_path, shuffled, log).accepted == 900
    assert sorted(stored(log), key=lambda row: row.identity.sequence) == rows[:900]


def damaged(path: Path, change: Callable[[bytes], bytes]) -> Path:
    path.write_bytes(change(path.read_bytes()))
    return path


def test_an_empty_file_is_named_and_the_next_one_goes_in(vehicle_log: Path, rows: Rows, log: McapLog) -> None:
    empty = vehicle_log.with_name("empty.mcap")
    empty.touch()
    report = ingest_logs([empty, vehicle_log], log)
    assert stored(log) == rows
    assert {Path(file.path).name for file in report.damaged} == {"empty.mcap"}
    assert "0 bytes" in report.complaints()[0]


def test_a_file_that_is_no_mcap_is_named_and_takes_nothing(vehicle_log: Path, log: McapLog) -> None:
    report = ingest_logs([damaged(vehicle_log, lambda _: b"lat,lon\n1,2\n" * 100)], log)
    assert report.accepted == 0
    assert report.damaged


def test_a_truncated_log_gives_every_whole_chunk_and_names_the_loss(
    long_log: Path, long_rows: Rows, log: McapLog
) -> None:
    report = ingest_logs([damaged(long_log, lambda data: data[: len(data) * 2 // 3])], log)
    kept = stored(log)
    assert 0 < len(kept) < len(long_rows)
    assert kept == long_rows[: len(kept)]
    assert "messages lost" in report.complaints()[0]


def test_a_flipped_bit_costs_its_chunk_only(long_log: Path, long_rows: Rows, log: McapLog) -> None:
    middle = long_log.stat().st_size // 2
    damaged(long_log, lambda data: data[:middle] + bytes([data[middle] ^ 0x10]) + data[middle + 1 :])
    report = ingest_logs([long_log], log)
    kept = stored(log)
    lost = len(long_rows) - len(kept)
    first = next(index for index, row in enumerate(long_rows) if row not in kept[index : index + 1])
    assert kept == long_rows[:first] + long_rows[first + lost :]
    assert f"{lost} messages lost" in report.complaints()[0]


def test_what_damage_cost_comes_in_with_the_whole_log(long_log: Path, long_rows: Rows, log: McapLog) -> None:
    whole = long_log.read_bytes()
    ingest_logs([damaged(long_log, lambda data: data[: len(data) // 2])], log)
    long_log.write_bytes(whole)
    ingest_logs([long_log], log)
    assert stored(log) == long_rows


def test_a_path_that_is_no_file_stops_before_anything_is_taken(vehicle_log: Path, log: McapLog) -> None:
    with pytest.raises(InputError, match="nowhere"):
        ingest_logs([vehicle_log, vehicle_log.with_name("nowhere.mcap")], log)
    assert log.streams() == ()


FULL_DISK = """
import resource, signal, sys
from pathlib import Path
from trigpoint.errors import AppendFailed
from trigpoint.logs.mcap_log import McapLog
from trigpoint_ingest.recorded import ingest_logs
from trigpoint_ingest.settings import IngestSettings
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
log = McapLog(Path(sys.argv[2]))
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]), int(sys.argv[3])))
try:
    ingest_logs([Path(sys.argv[1])], log, settings=IngestSettings(batch_count=500))
except AppendFailed as error:
    sys.exit(f"AppendFailed {error}")
"""


def test_a_full_disk_stops_ingest_and_what_was_appended_stays(vehicle_log: Path, rows: Rows, tmp_path: Path) -> None:
    limit_bytes = 65_536  # of any one file: the write fails with a real OSError, as on a full disk
    finished = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(vehicle_log), str(tmp_path / "log"), str(limit_bytes)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert finished.stderr.startswith("AppendFailed"), finished.stderr
    log = McapLog(tmp_path / "log")
    kept = stored(log)
    assert 0 < len(kept) < 3000
    assert kept == rows[: len(kept)]
    ingest_logs([vehicle_log], log)
    assert stored(log) == rows
    log.close()

"""The service on a log and on live messages: the same estimates either way, each appended once."""

import math
import threading
from collections.abc import Sequence
from dataclasses import replace

import pytest

from driven_paths.examples import FRAME, START_NS, Course, driven
from trigpoint.bus.event_messages import event_message
from trigpoint.bus.memory_bus import MemoryBus, MemoryExchange, MemoryNews
from trigpoint.bus.ports import BusMessage
from trigpoint.events.codec import Event, decode, encode
from trigpoint.events.drives import Drive
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.estimated import FixJudged, PoseFiltered
from trigpoint.events.keys import key_of
from trigpoint.events.observed import GnssFixReceived, ImuMeasured, MapFramePinned, WheelSpeedMeasured
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.observability.metrics import Instruments
from trigpoint_filtering.app import filter_log
from trigpoint_filtering.live import LiveFiltering

COURSE = Course(duration_s=60.0)


def rows_of(drive: Drive, *, vehicle: str = "car") -> list[Envelope[Event]]:
    """A drive's events in order of time, numbered from 0."""
    events: list[tuple[int, Event]] = [(START_NS - 1, drive.described)]
    for stamp, speed in zip(drive.wheels.stamp_ns.tolist(), drive.wheels.speed_mps.tolist(), strict=True):
        events.append((stamp, WheelSpeedMeasured(speed_mps=speed, steering_rad=math.nan, yaw_rate_radps=math.nan)))
    for stamp, rate in zip(drive.imu.stamp_ns.tolist(), drive.imu.yaw_rate_radps.tolist(), strict=True):
        imu = ImuMeasured(yaw_rate_radps=rate, acceleration_x_mps2=math.nan, acceleration_y_mps2=math.nan)
        events.append((stamp, imu))
    fixes = drive.fixes
    for stamp, lat, lon in zip(fixes.stamp_ns.tolist(), fixes.lat_deg.tolist(), fixes.lon_deg.tolist(), strict=True):
        events.append((stamp, GnssFixReceived(lat_deg=lat, lon_deg=lon, height_m=math.nan, sigma_m=2.0)))
    events.sort(key=lambda row: row[0])
    return [
        Envelope(EventIdentity(vehicle, "boot", number), stamp, event) for number, (stamp, event) in enumerate(events)
    ]


def pinned_log(rows: Sequence[Envelope[Event]] = ()) -> MemoryLog:
    log = MemoryLog()
    pinned = MapFramePinned(
        crs=FRAME.crs,
        origin_easting_m=FRAME.origin_easting_m,
        origin_northing_m=FRAME.origin_northing_m,
        declared_by="test",
    )
    log.append("map", [Envelope(EventIdentity("ingest", "frame", 0), START_NS, pinned)])
    if rows:
        log.append(f"veh-{rows[0].identity.source}", rows)
    return log


def said(log: MemoryLog) -> list[tuple[EventIdentity, int, bytes]]:
    rows = [logged.envelope for logged in log.read("filtering")]
    return [(row.identity, row.stamp_ns, encode(row.event)[1]) for row in rows]


def message_of(row: Envelope[Event]) -> BusMessage:
    return event_message(row, key=key_of(row))


def heard_live(log: MemoryLog, rows: Sequence[Envelope[Event]], heard: Sequence[Envelope[Event]]) -> None:
    """Live filtering of what `heard` brings over the bus, while all `rows` are in the log."""
    if rows:
        log.append("veh-car", rows)
    exchange = MemoryExchange()
    with MemoryBus(exchange) as sender, LiveFiltering(log, MemoryBus(exchange)) as service:
        for row in heard:
            sender.publish(message_of(row))
            service.step(0.0)


def test_every_fix_of_the_log_gets_a_verdict_and_the_drive_gets_poses() -> None:
    log = pinned_log(rows_of(driven(COURSE).drive))
    report = filter_log(log)[0]
    assert report.accepted + report.rejected == 60
    assert report.refusal == ""
    kinds = [type(logged.envelope.event) for logged in log.read("filtering")]
    assert (kinds.count(FixJudged), len(kinds)) == (60, report.appended)
    assert 200 < kinds.count(PoseFiltered) <= 300  # 5 Hz for the minute less the start


def test_filtering_the_same_log_again_appends_nothing() -> None:
    log = pinned_log(rows_of(driven(COURSE).drive))
    filter_log(log)
    before = said(log)
    assert [report.appended for report in filter_log(log)] == [0]
    assert said(log) == before


def test_a_log_cut_short_while_writing_is_completed() -> None:
    rows = rows_of(driven(COURSE).drive)
    whole, cut = pinned_log(rows), pinned_log(rows)
    filter_log(whole)
    cut.append("filtering", [logged.envelope for logged in whole.read("filtering")][:37])
    filter_log(cut)
    assert said(cut) == said(whole)


def test_a_drive_that_grows_is_filtered_on_from_where_it_was() -> None:
    rows = rows_of(driven(COURSE).drive)
    whole, growing = pinned_log(rows), pinned_log(rows[:700])
    filter_log(whole)
    filter_log(growing)
    growing.append("veh-car", rows[700:])
    filter_log(growing)
    assert said(growing) == said(whole)


def test_a_drive_that_cannot_be_filtered_is_reported_and_the_others_go_on() -> None:
    drive = driven(COURSE).drive
    deaf = [row for row in rows_of(drive, vehicle="aaa") if not isinstance(row.event, GnssFixReceived)]
    log = pinned_log(deaf)
    log.append("veh-car", rows_of(drive))
    reports = filter_log(log)
    assert [(report.vehicle, report.refusal) for report in reports] == [("aaa", "no fixes"), ("car", "")]


def test_without_a_pinned_frame_nothing_is_filtered(caplog: pytest.LogCaptureFixture) -> None:
    assert filter_log(MemoryLog()) == ()
    assert "no map frame is pinned" in caplog.text


def test_live_messages_give_what_the_log_gives() -> None:
    rows = rows_of(driven(COURSE).drive)
    whole, live = pinned_log(rows), pinned_log()
    filter_log(whole)
    heard_live(live, rows, rows)
    assert said(live) == said(whole)


def test_messages_lost_on_the_bus_are_taken_from_the_log() -> None:
    rows = rows_of(driven(COURSE).drive)
    whole, live = pinned_log(rows), pinned_log()
    filter_log(whole)
    heard_live(live, rows, [row for row in rows[:-40] if row.identity.sequence % 11])
    assert said(live) == said(whole)


def test_a_message_that_cannot_be_read_is_taken_from_the_log() -> None:
    rows = rows_of(driven(COURSE).drive)
    whole, live, exchange = pinned_log(rows), pinned_log(rows), MemoryExchange()
    filter_log(whole)
    with MemoryBus(exchange) as sender, LiveFiltering(live, MemoryBus(exchange)) as service:
        for message in (message_of(rows[0]), replace(message_of(rows[1]), payload=b"\xff"), message_of(rows[2])):
            sender.publish(message)
            service.step(0.0)
    assert said(live) == said(whole)


def test_a_restarted_service_says_nothing_twice() -> None:
    rows = rows_of(driven(COURSE).drive)
    whole, live = pinned_log(rows), pinned_log(rows)
    filter_log(whole)
    heard_live(live, [], rows[:600])
    heard_live(live, [], rows[600:])
    assert said(live) == said(whole)


class SteadyBus(MemoryBus):
    """A bus on which there is always one more message; told to stop after some of them."""

    def __init__(self, row: Envelope[Event], stop: threading.Event) -> None:
        super().__init__()
        self._row, self._stop, self._heard = row, stop, 0

    def news(self, key_expression: str) -> MemoryNews:
        news = super().news(key_expression)
        wait = news.wait

        def more(timeout_s: float) -> bool:
            self.publish(message_of(self._row))
            self._heard += 1
            if self._heard > 5:
                self._stop.set()
            return wait(timeout_s)

        news.wait = more  # type: ignore[method-assign]
        return news


def test_estimates_are_in_the_log_while_messages_never_cease() -> None:
    rows = rows_of(driven(COURSE).drive)[:200]
    log, stop = pinned_log(rows), threading.Event()
    LiveFiltering(log, SteadyBus(rows[0], stop)).run(stop)
    assert said(log)


def test_a_service_is_ready_once_it_has_taken_what_the_log_holds() -> None:
    log = pinned_log(rows_of(driven(COURSE).drive))
    instruments = Instruments("filtering")
    with MemoryBus() as bus, LiveFiltering(log, bus, instruments=instruments) as service:
        assert not service.ready
        assert service.step(0.0)
        while service.step(0.0):
            pass
        assert service.ready
    assert b"trigpoint_projection_lag_events 0.0" in instruments.exposition()


@pytest.mark.parametrize("cut", [1, 37, 250])
def test_a_service_started_anew_goes_on_where_the_one_before_was_killed(cut: int) -> None:
    rows = rows_of(driven(COURSE).drive)
    whole, killed = pinned_log(rows), pinned_log(rows)
    filter_log(whole)
    killed.append("filtering", [logged.envelope for logged in whole.read("filtering")][:cut])
    heard_live(killed, [], [])
    assert said(killed) == said(whole)


def test_a_drive_that_comes_after_others_of_its_vehicle_is_followed_and_the_old_ones_are_let_go() -> None:
    rows = rows_of(driven(Course(duration_s=15.0)).drive)
    boots = [[replace(row, identity=replace(row.identity, boot_id=f"boot-{n}")) for row in rows] for n in range(5)]
    whole, live = pinned_log(), pinned_log()
    for boot in boots:
        whole.append("veh-car", boot)
        live.append("veh-car", boot)
    filter_log(whole)
    heard_live(live, [], [])
    heard_live(live, [], [])
    assert sorted(said(live), key=str) == sorted(said(whole), key=str)


def test_estimates_are_published_once_they_are_in_the_log() -> None:
    rows = rows_of(driven(COURSE).drive)
    log, exchange = pinned_log(rows), MemoryExchange()
    with MemoryBus(exchange) as bus:
        listening = bus.subscribe("trigpoint/v1/veh/car/est/fix")
        with LiveFiltering(log, MemoryBus(exchange)) as service:
            bus.publish(message_of(rows[-1]))
            service.step(0.0)
        first = listening.receive(0.0)
    assert first is not None
    assert isinstance(decode(first.schema_name, first.payload), FixJudged)

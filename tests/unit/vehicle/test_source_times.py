"""Clocks without leap seconds become Unix time."""

from datetime import UTC, datetime

import pytest

from trigpoint_vehicle.core.source_times import GPS_EPOCH, TimeScale, leap_correction_ns, unix_ns

SECOND_NS = 1_000_000_000


@pytest.mark.parametrize(
    ("scale", "year", "ahead_s"),
    [("gps", 2024, 18), ("gps", 2013, 16), ("gps", 1980, 0), ("tai", 2024, 37), ("utc", 2024, 0)],
)
def test_a_clock_is_ahead_of_utc_by_the_leap_seconds_of_its_day(scale: TimeScale, year: int, ahead_s: int) -> None:
    count_ns = unix_ns(datetime(year, 3, 4, tzinfo=UTC)) + ahead_s * SECOND_NS
    assert leap_correction_ns(count_ns, scale) == -ahead_s * SECOND_NS


def test_the_18th_leap_second_of_gps_begins_on_its_very_second() -> None:
    begin_ns = unix_ns(datetime(2017, 1, 1, tzinfo=UTC))
    assert leap_correction_ns(begin_ns + 18 * SECOND_NS, "gps") == -18 * SECOND_NS
    assert leap_correction_ns(begin_ns + 17 * SECOND_NS - 1, "gps") == -17 * SECOND_NS


def test_gps_week_and_seconds_of_a_known_day() -> None:
    # GPS week 2304 began on 2024-03-03 at 00:00:00 GPS time
    count_ns = unix_ns(GPS_EPOCH) + 2304 * 7 * 86_400 * SECOND_NS
    assert count_ns + leap_correction_ns(count_ns, "gps") == unix_ns(datetime(2024, 3, 2, 23, 59, 42, tzinfo=UTC))

"""Instants of a source's clock as nanoseconds since the Unix epoch."""

from datetime import UTC, datetime, timedelta
from typing import Literal

TimeScale = Literal["utc", "gps", "tai"]
TimeUnit = Literal["s", "ms", "us", "ns"]

UNIT_NS: dict[str, int] = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1_000, "ns": 1}
UNIX_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)
GPS_FROM_TAI_S = -19
# The day from which TAI - UTC had this many seconds (IERS Bulletin C); none has been announced since.
TAI_FROM_UTC_S = (
    (datetime(1980, 1, 1, tzinfo=UTC), 19),
    (datetime(1981, 7, 1, tzinfo=UTC), 20),
    (datetime(1982, 7, 1, tzinfo=UTC), 21),
    (datetime(1983, 7, 1, tzinfo=UTC), 22),
    (datetime(1985, 7, 1, tzinfo=UTC), 23),
    (datetime(1988, 1, 1, tzinfo=UTC), 24),
    (datetime(1990, 1, 1, tzinfo=UTC), 25),
    (datetime(1991, 1, 1, tzinfo=UTC), 26),
    (datetime(1992, 7, 1, tzinfo=UTC), 27),
    (datetime(1993, 7, 1, tzinfo=UTC), 28),
    (datetime(1994, 7, 1, tzinfo=UTC), 29),
    (datetime(1996, 1, 1, tzinfo=UTC), 30),
    (datetime(1997, 7, 1, tzinfo=UTC), 31),
    (datetime(1999, 1, 1, tzinfo=UTC), 32),
    (datetime(2006, 1, 1, tzinfo=UTC), 33),
    (datetime(2009, 1, 1, tzinfo=UTC), 34),
    (datetime(2012, 7, 1, tzinfo=UTC), 35),
    (datetime(2015, 7, 1, tzinfo=UTC), 36),
    (datetime(2017, 1, 1, tzinfo=UTC), 37),
)


def unix_ns(instant: datetime) -> int:
    """Nanoseconds of an instant since the Unix epoch."""
    return (instant - UNIX_EPOCH) // timedelta(microseconds=1) * 1_000


def _tai_from_utc_s(tai_count_ns: int) -> int:
    # a count of TAI seconds since 1970 as if there were no leap seconds
    passed = [ahead_s for begin, ahead_s in TAI_FROM_UTC_S if tai_count_ns >= unix_ns(begin) + ahead_s * UNIT_NS["s"]]
    return passed[-1] if passed else TAI_FROM_UTC_S[0][1]


def leap_correction_ns(count_ns: int, scale: TimeScale) -> int:
    """What to add to a clock reading, counted on from the Unix epoch without leap seconds, to get Unix time."""
    if scale == "utc":
        return 0
    ahead_s = GPS_FROM_TAI_S if scale == "gps" else 0
    tai_count_ns = count_ns - ahead_s * UNIT_NS["s"]
    return -(_tai_from_utc_s(tai_count_ns) + ahead_s) * UNIT_NS["s"]

"""Where drives can have been by their fixes: never nearer to nothing than they were, whatever receivers say."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from trigpoint.events.drives import FixSeries
from trigpoint_perception.core.closures.extents import (
    EARTH_RADIUS_M,
    FIX_OFF_M,
    MEETING_M,
    SPEED_MAX_MPS,
    STRETCH_S,
    cannot_meet,
    earth_points,
    extent_of,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LAT_DEG, LON_DEG = -33.89, 151.19
DEGREE_M = 111_195.0  # of latitude, on a sphere of 6371 km
SPEED_MPS = 10.0
APART_M = 2.0 * FIX_OFF_M + MEETING_M  # between fixes of two drives at one time each
OBLIQUE = 1.75  # boxes along axes reach up to the square root of 3 farther in other directions


def stamps(duration_s: float, *, begin_s: float = 0.0) -> Ints:
    """Ten a second."""
    return np.round((begin_s + np.arange(0.0, duration_s, 0.1)) * 1e9).astype(np.int64)


def driven_m(stamp_ns: Ints) -> Floats:
    """How far a drive came by then."""
    return np.asarray(SPEED_MPS * 1e-9 * stamp_ns, dtype=np.float64)


def fixes(stamp_ns: Ints, north_m: Floats | float, *, sigma_m: float = np.nan) -> FixSeries:
    """Fixes so far north of Sydney."""
    count = len(stamp_ns)
    return FixSeries(
        stamp_ns=stamp_ns,
        lat_deg=LAT_DEG + np.broadcast_to(north_m, (count,)) / DEGREE_M,
        lon_deg=np.full(count, LON_DEG),
        sigma_m=np.full(count, sigma_m),
        sequence=np.arange(count, dtype=np.int64),
    )


def apart(one: FixSeries, other: FixSeries, *, swept_ns: Ints | None = None) -> bool:
    """Whether drives that sweep at their fixes' times, or the one at others, cannot have met."""
    return cannot_meet(extent_of(one.stamp_ns if swept_ns is None else swept_ns, one), extent_of(other.stamp_ns, other))


def test_drives_a_town_apart_cannot_have_met() -> None:
    at_ns = stamps(60.0)
    assert apart(fixes(at_ns, 0.0), fixes(at_ns, 20_000.0))


@pytest.mark.parametrize("off_m", [0.0, 80.0, -150.0])
def test_a_receiver_that_is_off_by_so_much_hides_no_meeting(off_m: float) -> None:
    at_ns = stamps(60.0)
    assert not apart(fixes(at_ns, off_m), fixes(at_ns, -off_m))


def test_the_margin_is_that_of_both_receivers() -> None:
    at_ns = stamps(1.0)
    assert not apart(fixes(at_ns, 0.0), fixes(at_ns, 0.99 * APART_M))
    assert apart(fixes(at_ns, 0.0), fixes(at_ns, OBLIQUE * APART_M))


def test_a_receiver_that_says_it_knows_less_is_taken_at_its_word() -> None:
    at_ns = stamps(1.0)
    assert not apart(fixes(at_ns, 0.0, sigma_m=5_000.0), fixes(at_ns, 20_000.0))


def test_drives_whose_boxes_are_apart_cannot_have_met_though_their_roads_run_side_by_side() -> None:
    at_ns = stamps(2_000.0)
    along_m = driven_m(at_ns)
    ahead = fixes(at_ns, along_m + 25_000.0)
    assert apart(fixes(at_ns, along_m), ahead)
    assert not apart(fixes(at_ns, along_m), fixes(at_ns, along_m + 19_000.0))


def test_while_a_receiver_is_silent_a_vehicle_may_be_as_far_as_it_can_drive() -> None:
    silent_s = 100.0
    swept_ns = stamps(silent_s)
    only_first = fixes(swept_ns[:1], 0.0)
    reached_m = silent_s * SPEED_MAX_MPS
    assert not apart(only_first, fixes(swept_ns[:1], reached_m), swept_ns=swept_ns)
    assert apart(only_first, fixes(swept_ns[:1], OBLIQUE * (reached_m + APART_M)), swept_ns=swept_ns)


def test_some_seconds_of_fixes_in_another_town_hide_no_meeting() -> None:
    at_ns = stamps(600.0)
    north_m = driven_m(at_ns)
    wrong = (at_ns > 200e9) & (at_ns < 220e9)
    meeting = fixes(at_ns[2100:2110], north_m[2100:2110])  # where the other's fixes are wrong
    assert not apart(fixes(at_ns, np.where(wrong, 50_000.0, north_m)), meeting)


def test_the_last_seconds_of_a_drive_are_not_a_box_of_their_own() -> None:
    at_ns = stamps(STRETCH_S + 10.0)
    wrong = at_ns > STRETCH_S * 1e9
    end = fixes(at_ns[-10:], 0.0)
    assert not apart(fixes(at_ns, np.where(wrong, 50_000.0, 0.0)), end)


@pytest.mark.parametrize("unknown", [fixes(stamps(0.0), 0.0), fixes(stamps(1.0), np.nan)])
def test_a_drive_without_a_fix_may_have_been_anywhere(unknown: FixSeries) -> None:
    at_ns = stamps(1.0)
    assert not apart(unknown, fixes(at_ns, 20_000.0), swept_ns=at_ns)


def test_on_both_sides_of_the_date_line_drives_are_near() -> None:
    at_ns = stamps(1.0)
    sides = [
        FixSeries(
            stamp_ns=at_ns,
            lat_deg=np.full(len(at_ns), -17.0),
            lon_deg=np.full(len(at_ns), lon_deg),
            sigma_m=np.full(len(at_ns), np.nan),
            sequence=np.arange(len(at_ns), dtype=np.int64),
        )
        for lon_deg in (179.9999, -179.9999)
    ]
    assert not apart(*sides)


def test_fixes_and_sweeps_come_in_any_order() -> None:
    at_ns = stamps(600.0)
    north_m = driven_m(at_ns)
    series, turned = fixes(at_ns, north_m), fixes(at_ns[::-1], north_m[::-1])
    one, other = extent_of(at_ns, series), extent_of(at_ns[::-1], turned)
    assert one is not None
    assert other is not None
    assert np.array_equal(one.low_m, other.low_m)
    assert np.array_equal(one.high_m, other.high_m)


@pytest.mark.data
@pytest.mark.parametrize("session", ["2012-11-04", "2013-01-10"])  # fixes of theirs are off by up to 112 and 22 m
def test_no_place_of_a_recorded_drive_is_outside_its_extent(recorded_drives: Path, session: str) -> None:
    rows = np.genfromtxt(recorded_drives / "nclt" / f"nclt_{session}.csv", delimiter=",", names=True)
    stamp_ns = np.round(rows["t_s"] * 1e9).astype(np.int64)
    lat_deg, lon_deg = np.degrees((rows["gps_north_m"], rows["gps_east_m"])) / EARTH_RADIUS_M  # off the coast of Africa
    unknown = np.full(len(rows), np.nan)
    extent = extent_of(
        stamp_ns, FixSeries(stamp_ns=stamp_ns, lat_deg=lat_deg, lon_deg=lon_deg, sigma_m=unknown, sequence=stamp_ns)
    )
    assert extent is not None
    true = earth_points(*np.degrees((rows["gt_north_m"], rows["gt_east_m"])) / EARTH_RADIUS_M)[:, None]
    inside = np.all((true >= extent.low_m) & (true <= extent.high_m), axis=2)
    assert np.all(np.any(inside, axis=1))

"""What is taken together is what would be taken one by one: a payload found plain is valid, and comes out as it was."""

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from event_examples.any_event import ANY_EVENT
from trigpoint.errors import EventRejected
from trigpoint.events.codec import decode, encode, schema_name
from trigpoint.events.observed import (
    GnssFixReceived,
    ImuMeasured,
    LandmarkDetection,
    LandmarksDetected,
    Observed,
    VehicleDescribed,
    WheelSpeedMeasured,
)
from trigpoint_ingest.core.limits import within_limits
from trigpoint_ingest.core.plain_payloads import PlainPayloads

IMU = ImuMeasured(yaw_rate_radps=0.1, acceleration_x_mps2=math.nan, acceleration_y_mps2=0.2)
FIX = GnssFixReceived(lat_deg=-33.8, lon_deg=151.2, height_m=20.0, sigma_m=3.0)
WHEEL = WheelSpeedMeasured(speed_mps=3.0, steering_rad=0.1, yaw_rate_radps=math.nan)


KINDS = (ImuMeasured, GnssFixReceived, WheelSpeedMeasured, LandmarksDetected, VehicleDescribed)


def sweep(*bearings_rad: float, kind: str = "pole") -> LandmarksDetected:
    return LandmarksDetected(
        detections=tuple(LandmarkDetection(10.0, bearing, kind, "", math.nan) for bearing in bearings_rad)
    )


def plain(events: Sequence[Observed]) -> list[bool]:
    """Which are plain, each kind together with twenty that surely are, so that its shape is learnt."""
    found = []
    for event in events:
        schema, payload = encode(event)
        found.append(bool(PlainPayloads().plain(schema, [payload] * 20)[0]))
    return found


def is_valid_as_it_is(schema: str, payload: bytes) -> bool:
    try:
        event = decode(schema, payload)
        return within_limits(event) is event  # type: ignore[arg-type]  # an observation
    except EventRejected:
        return False


@pytest.mark.parametrize("event", [IMU, FIX, replace(FIX, sigma_m=math.nan), WHEEL, sweep(0.1, -3.0), sweep()])
def test_what_vehicles_usually_send_is_plain(event: Observed) -> None:
    assert plain([event]) == [True]


@pytest.mark.parametrize(
    "event",
    [
        ImuMeasured(yaw_rate_radps=36.0, acceleration_x_mps2=0.1, acceleration_y_mps2=0.1),
        ImuMeasured(yaw_rate_radps=math.nan, acceleration_x_mps2=0.1, acceleration_y_mps2=0.1),
        ImuMeasured(yaw_rate_radps=0.1, acceleration_x_mps2=math.inf, acceleration_y_mps2=0.1),
        GnssFixReceived(lat_deg=91.0, lon_deg=151.2, height_m=20.0, sigma_m=3.0),
        GnssFixReceived(lat_deg=-0.0, lon_deg=-0.0, height_m=20.0, sigma_m=3.0),
        GnssFixReceived(lat_deg=1.0, lon_deg=151.2, height_m=20.0, sigma_m=-3.0),
        GnssFixReceived(lat_deg=1.0, lon_deg=151.2, height_m=20.0, sigma_m=0.0),
        sweep(3.2),
        sweep(math.pi),
        sweep(0.1, kind="p" * 201),
        sweep(0.1, kind="Laterne ä"),
        VehicleDescribed(vehicle="van"),
    ],
)
def test_what_is_wrong_or_unusual_is_looked_at_by_itself(event: Observed) -> None:
    assert plain([event]) == [False]


@given(st.lists(st.one_of(*(ANY_EVENT[kind] for kind in KINDS)), min_size=1, max_size=6))
def test_whatever_is_plain_is_valid_as_it_is(events: list[Observed]) -> None:
    recogniser = PlainPayloads()
    for event in events:
        schema, payload = encode(event)
        if recogniser.plain(schema, [payload] * 6)[0]:
            assert is_valid_as_it_is(schema, payload)


@given(payload=st.binary(max_size=60), schema=st.sampled_from([IMU, FIX, WHEEL, sweep()]))
def test_whatever_bytes_are_plain_hold_a_valid_event(payload: bytes, schema: Observed) -> None:
    name = schema_name(type(schema))
    if PlainPayloads().plain(name, [payload] * 6)[0]:
        assert is_valid_as_it_is(name, payload)


@given(event=st.sampled_from([IMU, FIX, WHEEL, sweep(0.1, -3.0)]), at=st.integers(0, 200), byte=st.integers(0, 255))
def test_a_byte_changed_is_plain_only_where_the_event_is_still_valid(event: Observed, at: int, byte: int) -> None:
    schema, payload = encode(event)
    at %= len(payload)
    changed = payload[:at] + bytes([byte]) + payload[at + 1 :]
    found = PlainPayloads().plain(schema, [payload] * 20 + [changed])
    assert found[0]
    assert not found[-1] or is_valid_as_it_is(schema, changed)


def test_payloads_of_different_lengths_are_each_judged() -> None:
    schema, long = encode(sweep(0.1, 0.2))
    short, wrong = encode(sweep(0.1))[1], encode(sweep(0.1, 4.0))[1]
    found = PlainPayloads().plain(schema, [long, short, wrong] * 10)
    assert found.tolist() == [True, True, False] * 10


def test_a_fix_that_says_it_has_a_covariance_and_has_none_is_not_plain() -> None:
    schema, payload = encode(GnssFixReceived(lat_deg=1.0, lon_deg=2.0, height_m=3.0, sigma_m=math.nan))
    says_so = payload + b"\x28\x02"  # position_covariance_type 2
    assert not PlainPayloads().plain(schema, [says_so] * 20).any()

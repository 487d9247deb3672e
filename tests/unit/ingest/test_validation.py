"""What a message must be to enter the log."""

import math
from dataclasses import fields, replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trigpoint.bus.ports import UNIDENTIFIED, BusMessage
from trigpoint.errors import EventRejected
from trigpoint.events.codec import Event, encode
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import (
    GnssFixReceived,
    ImuMeasured,
    LandmarkDetection,
    LandmarksDetected,
    Observed,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint_ingest.core.limits import LIMITS, FieldLimit
from trigpoint_ingest.core.stamps import DriveStamps, StampLimits
from trigpoint_ingest.core.validation import validate

S = 1_000_000_000  # ns
T0 = 1_700_000_000 * S
FIX = GnssFixReceived(lat_deg=-33.8, lon_deg=151.2, height_m=20.0, sigma_m=3.0)
WHEEL = WheelSpeedMeasured(speed_mps=5.0, steering_rad=0.1, yaw_rate_radps=math.nan)
IMU = ImuMeasured(yaw_rate_radps=0.1, acceleration_x_mps2=math.nan, acceleration_y_mps2=math.nan)
PAIR = WheelPairMeasured(left_mps=1.0, right_mps=1.1)
TREE = LandmarkDetection(range_m=10.0, bearing_rad=0.5, kind="tree", signature="", diameter_m=math.nan)
SWEEP = LandmarksDetected(detections=(TREE,))
DESCRIBED = VehicleDescribed(vehicle="veh-a", wheelbase_m=2.8)
EVERY_KIND: tuple[Observed, ...] = (FIX, WHEEL, IMU, PAIR, SWEEP, DESCRIBED)


def message(event: Event, *, stamp_ns: int = T0, source: str = "veh-a", sequence: int = 1) -> BusMessage:
    schema_name, payload = encode(event)
    identity = EventIdentity(source, "boot", sequence)
    return BusMessage(key="k", schema_name=schema_name, payload=payload, identity=identity, stamp_ns=stamp_ns)


def judged(
    raw: BusMessage,
    *,
    described: bool = True,
    stamps: DriveStamps | None = None,
    fleet: frozenset[str] | None = None,
) -> Envelope[Observed]:
    return validate(raw, described=described, stamps=stamps or DriveStamps(), limits=StampLimits(), fleet=fleet)


def reason_of(raw: BusMessage, *, described: bool = True, fleet: frozenset[str] | None = None) -> str:
    with pytest.raises(EventRejected) as caught:
        judged(raw, described=described, fleet=fleet)
    return caught.value.reason


def stamps_after(*pairs: tuple[type, int]) -> DriveStamps:
    stamps = DriveStamps()
    for sensor, stamp_ns in pairs:
        stamps.accept(sensor, stamp_ns)
    return stamps


@pytest.mark.parametrize("event", EVERY_KIND, ids=lambda event: type(event).__name__)
def test_a_sound_event_of_every_kind_is_accepted_as_it_is(event: Observed) -> None:
    envelope = judged(message(event))
    assert repr(envelope) == repr(Envelope(EventIdentity("veh-a", "boot", 1), T0, event))  # NaN is not equal to NaN


def test_every_number_of_every_kind_has_a_limit() -> None:
    for kind, limits in LIMITS.items():
        numbers = {field.name for field in fields(kind) if field.type in (float, "float")}
        assert numbers == {limit.name for limit in limits}, kind


NUMBERS = [
    pytest.param(event, limit, id=f"{type(event).__name__}.{limit.name}")
    for event in (*EVERY_KIND, TREE)
    for limit in LIMITS[type(event)]
]


def with_number(event: Observed | LandmarkDetection, name: str, value: float) -> Observed:
    changed = replace(event, **{name: value})  # type: ignore[arg-type]
    return LandmarksDetected(detections=(changed,)) if isinstance(changed, LandmarkDetection) else changed


@pytest.mark.parametrize(("event", "limit"), NUMBERS)
@settings(max_examples=25)  # for each of some thirty numbers
@given(data=st.data())
def test_a_number_goes_in_exactly_within_its_limits(event: Observed, limit: FieldLimit, data: st.DataObject) -> None:
    span = limit.highest - limit.lowest
    value = data.draw(st.floats(limit.lowest - span, limit.highest + span) | st.sampled_from([math.inf, -math.inf]))
    raw = message(with_number(event, limit.name, value))
    if limit.lowest <= value <= limit.highest:
        judged(raw)
    else:
        assert reason_of(raw) == ("out of range" if math.isfinite(value) else "not finite")


@pytest.mark.parametrize(("event", "limit"), NUMBERS)
def test_nan_goes_in_only_where_it_says_not_measured(event: Observed, limit: FieldLimit) -> None:
    raw = message(with_number(event, limit.name, math.nan))
    if limit.or_nan:
        judged(raw)
    else:
        assert reason_of(raw) == "not finite"


def test_latitude_91_is_refused_with_value_and_limit() -> None:
    with pytest.raises(EventRejected, match=r"lat_deg 91 is outside -90 to 90"):
        judged(message(replace(FIX, lat_deg=91.0)))


def test_a_fix_at_exactly_zero_zero_is_no_fix() -> None:
    assert reason_of(message(replace(FIX, lat_deg=0.0, lon_deg=0.0))) == "out of range"


@given(turns=st.floats(-2.0 * math.pi, 2.0 * math.pi))
def test_a_bearing_is_wrapped_into_half_a_turn_each_way(turns: float) -> None:
    event = judged(message(LandmarksDetected(detections=(TREE, replace(TREE, bearing_rad=turns))))).event
    assert isinstance(event, LandmarksDetected)
    bearing_rad = event.detections[1].bearing_rad
    assert -math.pi <= bearing_rad < math.pi
    assert math.cos(bearing_rad) == pytest.approx(math.cos(turns), abs=1e-12)  # rounding of one wrap, dimensionless
    assert math.sin(bearing_rad) == pytest.approx(math.sin(turns), abs=1e-12)


def test_an_unknown_schema_is_refused() -> None:
    assert reason_of(replace(message(FIX), schema_name="sensor_msgs/NavSatFix")) == "unknown schema"


def test_what_only_a_service_may_say_is_refused_from_a_vehicle() -> None:
    label = AnchorLabelled(
        anchor="a",
        lat_deg=-33.8,
        lon_deg=151.2,
        sigma_m=0.1,
        image="",
        image_sigma_m=0.0,
        kind="pole",
        signature="",
        source_crs="EPSG:4326",
        operation="",
    )
    assert reason_of(message(label)) == "unknown schema"


def test_bytes_that_are_no_protobuf_are_undecodable() -> None:
    assert reason_of(replace(message(FIX), payload=b"\xff\xff\xff")) == "undecodable"


@given(payload=st.binary(max_size=200), event=st.sampled_from(EVERY_KIND))
def test_any_bytes_are_accepted_or_refused_and_nothing_else(payload: bytes, event: Observed) -> None:
    try:
        assert judged(replace(message(event), payload=payload)).stamp_ns == T0
    except EventRejected:
        return  # refused for a reason of its own is as good; any other exception fails the test


def test_a_vehicle_that_has_not_described_itself_is_unknown() -> None:
    assert reason_of(message(FIX), described=False) == "unknown vehicle"


def test_a_vehicle_outside_the_fleet_is_unknown() -> None:
    assert reason_of(message(DESCRIBED), described=False, fleet=frozenset({"veh-b"})) == "unknown vehicle"


def test_a_vehicle_of_the_fleet_is_known_by_its_description() -> None:
    assert judged(message(DESCRIBED), described=False, fleet=frozenset({"veh-a"})).event == DESCRIBED


def test_a_vehicle_cannot_describe_another() -> None:
    assert reason_of(message(DESCRIBED, source="veh-b"), described=False) == "unknown vehicle"


@pytest.mark.parametrize("name", ["a/b", "a*", "x" * 61, "@a", "a\n"])
def test_a_name_that_no_key_can_have_is_an_unknown_vehicle(name: str) -> None:
    assert reason_of(message(replace(DESCRIBED, vehicle=name), source=name), described=False) == "unknown vehicle"


def test_a_message_without_identity_is_refused() -> None:
    assert reason_of(replace(message(FIX), identity=UNIDENTIFIED)) == "unidentified"


def test_an_unknown_crs_is_refused() -> None:
    with pytest.raises(EventRejected, match="EPSG:99999"):
        judged(message(replace(DESCRIBED, declared_crs="EPSG:99999")))


def test_a_crs_in_degrees_cannot_declare_a_map() -> None:
    assert reason_of(message(replace(DESCRIBED, declared_crs="EPSG:4326"))) == "unknown crs"


def test_time_an_hour_back_is_refused_with_both_times() -> None:
    stamps = stamps_after((GnssFixReceived, T0))
    with pytest.raises(EventRejected, match=rf"{T0 - 3600 * S} ns is 3600\.000 s before {T0} ns") as caught:
        judged(message(FIX, stamp_ns=T0 - 3600 * S), stamps=stamps)
    assert caught.value.reason == "time backwards"


@given(late_ns=st.integers(0, 10 * S))
def test_a_message_reordered_within_the_tolerance_is_accepted(late_ns: int) -> None:
    assert judged(message(FIX, stamp_ns=T0 - late_ns), stamps=stamps_after((GnssFixReceived, T0))).event == FIX


def test_one_sensor_may_lag_another() -> None:
    stamps = stamps_after((GnssFixReceived, T0), (WheelSpeedMeasured, T0 + 600 * S))
    assert judged(message(FIX, stamp_ns=T0 + S), stamps=stamps).event == FIX


@pytest.mark.parametrize("away_s", [-1801, 1801])
def test_a_stamp_far_from_all_of_the_drive_is_refused(away_s: int) -> None:
    with pytest.raises(EventRejected, match=r"1801\.000 s from the drive's .* limit 1800 s") as caught:
        judged(message(FIX, stamp_ns=T0 + away_s * S), stamps=stamps_after((ImuMeasured, T0)))
    assert caught.value.reason == "time jumped"


@pytest.mark.parametrize("stamp_ns", [-1, 2**63])
def test_a_stamp_that_no_log_holds_is_refused(stamp_ns: int) -> None:
    assert reason_of(message(FIX, stamp_ns=stamp_ns)) == "stamp out of range"

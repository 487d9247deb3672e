import contextlib
import math

import numpy as np
import pytest
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from hypothesis import given, settings
from hypothesis import strategies as st

from event_examples.any_event import ANY_EVENT, same_event
from trigpoint.errors import EventRejected
from trigpoint.events.codec import decode, encode, event_class, event_classes, schema_name, schema_version
from trigpoint.events.estimated import PoseFiltered
from trigpoint.events.observed import GnssFixReceived, ImuMeasured, LandmarksDetected


def _fix(sigma_m: float) -> GnssFixReceived:
    return GnssFixReceived(lat_deg=-33.9, lon_deg=151.2, height_m=math.nan, sigma_m=sigma_m)


def test_every_class_of_events_can_be_encoded() -> None:
    assert set(event_classes()) == set(ANY_EVENT)


@pytest.mark.parametrize("kind", ANY_EVENT, ids=lambda kind: kind.__name__)
@given(data=st.data())
@settings(max_examples=25, deadline=None, derandomize=True)
def test_an_event_comes_back_exactly(kind: type, data: st.DataObject) -> None:
    event = data.draw(ANY_EVENT[kind])
    assert same_event(decode(*encode(event)), event)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ANY_EVENT, ids=lambda kind: kind.__name__)
@given(payload=st.binary(max_size=60))
@settings(max_examples=20, deadline=None, derandomize=True)
def test_any_bytes_are_an_event_or_rejected(kind: type, payload: bytes) -> None:
    with contextlib.suppress(EventRejected):  # and nothing else
        assert type(decode(schema_name(kind), payload)) is kind


def test_a_fix_is_what_foxglove_shows_on_its_map() -> None:
    name, payload = encode(_fix(2.5))
    message = LocationFix.FromString(payload)
    assert (name, message.latitude, message.longitude) == ("foxglove.LocationFix", -33.9, 151.2)
    assert message.position_covariance[0] == 6.25  # 2.5 m squared


def test_a_fix_without_declared_sigma_has_an_unknown_covariance() -> None:
    message = LocationFix.FromString(encode(_fix(math.nan))[1])
    assert message.position_covariance_type == LocationFix.UNKNOWN


def test_a_foreign_fix_has_the_sigma_of_its_worse_horizontal_axis() -> None:
    foreign = LocationFix(
        position_covariance=[4.0, 0, 0, 0, 9.0, 0, 0, 0, 100.0], position_covariance_type=LocationFix.KNOWN
    )
    event = decode("foxglove.LocationFix", foreign.SerializeToString())
    assert isinstance(event, GnssFixReceived)
    assert event.sigma_m == 3.0


def test_a_fix_with_half_a_covariance_is_rejected() -> None:
    foreign = LocationFix(position_covariance=[4.0, 4.0], position_covariance_type=LocationFix.KNOWN)
    with pytest.raises(EventRejected, match="2 numbers, expected 9"):
        decode("foxglove.LocationFix", foreign.SerializeToString())


def test_an_unknown_schema_is_rejected_by_name() -> None:
    with pytest.raises(EventRejected, match="trigpoint.v9.Wished") as caught:
        decode("trigpoint.v9.Wished", b"")
    assert caught.value.reason == "unknown schema"


def test_a_truncated_payload_is_rejected() -> None:
    name, payload = encode(ImuMeasured(yaw_rate_radps=0.1, acceleration_x_mps2=0.2, acceleration_y_mps2=0.3))
    with pytest.raises(EventRejected) as caught:
        decode(name, payload[:-1])
    assert caught.value.reason == "undecodable"


def test_a_covariance_of_the_wrong_shape_is_not_encoded() -> None:
    event = PoseFiltered(
        vehicle="van", boot_id="b", x_m=0.0, y_m=0.0, heading_rad=0.0, speed_mps=0.0, covariance=np.eye(2)
    )
    with pytest.raises(EventRejected, match=r"\(2, 2\), expected \(3, 3\)"):
        encode(event)


def test_a_text_that_is_no_unicode_is_not_encoded() -> None:
    event = LandmarksDetected(detections=())
    assert decode(*encode(event)) == event
    with pytest.raises(EventRejected) as caught:
        encode(_with_broken_text())
    assert caught.value.reason == "unencodable"


def _with_broken_text() -> PoseFiltered:
    return PoseFiltered(
        vehicle="\ud800", boot_id="b", x_m=0.0, y_m=0.0, heading_rad=0.0, speed_mps=0.0, covariance=np.eye(3)
    )


def test_the_class_of_a_schema_is_found_and_an_unknown_one_is_not() -> None:
    assert event_class("trigpoint.v1.ImuMeasured") is ImuMeasured
    assert event_class("trigpoint.v1.Wished") is None


def test_known_schemas_have_version_1_and_unknown_ones_0() -> None:
    assert (schema_version(schema_name(GnssFixReceived)), schema_version("foreign.Message")) == (1, 0)

"""Where events go."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trigpoint.errors import InputError
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.estimated import GateAlarmed
from trigpoint.events.keys import key_expression, key_of, stream_of, valid_name
from trigpoint.events.mapped import LandmarkSolved, MapSolved
from trigpoint.events.observed import GnssFixReceived, MapFramePinned
from trigpoint.geodesy.positions import GridPosition
from trigpoint.geodesy.projection import pin_map_frame

FIX = GnssFixReceived(lat_deg=-33.9, lon_deg=151.2, height_m=20.0, sigma_m=3.0)
SYDNEY = pin_map_frame(crs="EPSG:32756", origin=GridPosition(334000.0, 6250000.0))


def said_by(source: str, event: object) -> Envelope[object]:
    return Envelope(EventIdentity(source, "boot", 0), 0, event)


def landmark_at(x_m: float, y_m: float) -> LandmarkSolved:
    return LandmarkSolved(
        map_version=1,
        landmark="L1",
        kind="pole",
        signature="",
        position_m=np.array([x_m, y_m]),
        covariance_m2=np.eye(2),
        observation_count=3,
        vehicles=("veh-a",),
        first_seen_ns=0,
        last_seen_ns=1,
        anchors=(),
        observations=(),
    )


def test_a_fix_goes_under_its_vehicle() -> None:
    assert key_of(said_by("veh-a", FIX)) == "trigpoint/v1/veh/veh-a/obs/gnss"
    assert stream_of(said_by("veh-a", FIX)) == "veh-veh-a"


def test_an_estimate_goes_under_the_vehicle_it_is_about_not_its_source() -> None:
    alarm = said_by("filtering", GateAlarmed(vehicle="veh-a", boot_id="boot", reason="silent", duration_s=60.0))
    assert key_of(alarm, root="fleet") == "fleet/v1/veh/veh-a/est/gate"
    assert stream_of(alarm) == "filtering"


def test_a_map_event_goes_under_its_map() -> None:
    pinned = MapFramePinned(crs="EPSG:32756", origin_easting_m=0.0, origin_northing_m=0.0, declared_by="veh-a")
    assert key_of(said_by("ingest", pinned), map_name="campus") == "trigpoint/v1/map/campus/frame"


def test_a_landmark_names_the_tile_it_stands_in() -> None:
    key = key_of(said_by("optimisation", landmark_at(0.0, 0.0)), frame=SYDNEY)
    assert key == "trigpoint/v1/map/main/lm/16/60294/39329"  # the cell of EPSG:3857 by pyproj: 60294.06, 39329.51


def test_a_landmark_without_a_frame_has_no_key() -> None:
    with pytest.raises(InputError, match="L1.*no map frame"):
        key_of(said_by("optimisation", landmark_at(0.0, 0.0)))


@pytest.mark.parametrize("name", ["", "a/b", "a*", "a?", "a#", "$a", "@a", "a\n", "a\x00", "x" * 61])
def test_a_name_that_cannot_be_a_chunk_is_refused_with_its_value(name: str) -> None:
    with pytest.raises(InputError, match="name '"):
        key_of(said_by(name, FIX))


@given(st.text(min_size=1, max_size=60))
def test_a_name_is_either_refused_or_one_chunk(name: str) -> None:
    try:
        valid_name(name)
    except InputError:
        return
    assert key_of(said_by(name, FIX)).split("/") == ["trigpoint", "v1", "veh", name, "obs", "gnss"]


def test_an_expression_has_a_star_for_each_name() -> None:
    assert key_expression(MapSolved) == "trigpoint/v1/map/*/version"

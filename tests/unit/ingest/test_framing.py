"""Which event pins the map's frame, and to what."""

import math

import pytest

from trigpoint.errors import FrameRefused
from trigpoint.events.observed import GnssFixReceived, ImuMeasured, MapFramePinned, VehicleDescribed
from trigpoint_ingest.core.framing import frame_pinned_by

SYDNEY_FIX = GnssFixReceived(lat_deg=-33.8886, lon_deg=151.1946, height_m=math.nan, sigma_m=math.nan)


def declared(crs: str) -> VehicleDescribed:
    return VehicleDescribed(
        vehicle="a", declared_crs=crs, declared_origin_easting_m=332_940.0, declared_origin_northing_m=6_248_560.0
    )


def test_a_declared_origin_is_taken_as_it_is() -> None:
    assert frame_pinned_by(declared("EPSG:32756")) == MapFramePinned(
        crs="EPSG:32756",
        origin_easting_m=332_940.0,
        origin_northing_m=6_248_560.0,
        declared_by="declared origin",
    )


def test_a_fix_pins_its_utm_zone_at_whole_kilometres() -> None:
    assert frame_pinned_by(SYDNEY_FIX) == MapFramePinned(
        crs="EPSG:32756", origin_easting_m=333_000.0, origin_northing_m=6_248_000.0, declared_by="first fix"
    )


def test_a_description_without_crs_pins_nothing() -> None:
    assert frame_pinned_by(VehicleDescribed(vehicle="a")) is None


def test_a_measurement_without_position_pins_nothing() -> None:
    imu = ImuMeasured(yaw_rate_radps=0.0, acceleration_x_mps2=0.0, acceleration_y_mps2=0.0)
    assert frame_pinned_by(imu) is None


def test_a_declared_crs_in_feet_is_refused() -> None:
    with pytest.raises(FrameRefused, match="metres"):
        frame_pinned_by(declared("EPSG:2263"))

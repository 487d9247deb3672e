"""One campus for all claims about it, and one without any noise."""

import pytest

from trigpoint_vehicle.core.campus import Campus, simulate_campus
from trigpoint_vehicle.core.campus_settings import (
    CampusSettings,
    GnssSettings,
    ImagerySettings,
    ImuSettings,
    MultipathSettings,
    SweepSettings,
    WheelSettings,
    with_known_signatures,
)

SEED = 7


@pytest.fixture(scope="session")
def campus() -> Campus:
    """The default campus of one seed."""
    return simulate_campus(SEED, CampusSettings())


@pytest.fixture(scope="session")
def exact_campus() -> Campus:
    """A campus with one vehicle whose sensors make no error and say which landmark they see."""
    settings = CampusSettings(
        vehicles=1,
        wheels=WheelSettings(scale_sigma=0.0, slip_sigma=0.0, white_mps=0.0, rate_hz=10.0),
        imu=ImuSettings(white_radps=0.0, bias_sigma_radps=0.0, bias_walk_radps_per_sqrt_s=0.0),
        gnss=GnssSettings(white_m=0.0, bias_m=0.0, multipath=MultipathSettings(count=0), car_park=None),
        sweeps=SweepSettings(
            rate_hz=1.0, range_sigma_m=0.0, bearing_sigma_rad=0.0, diameter_sigma_m=0.0, clutter_per_sweep=0.0
        ),
        imagery=ImagerySettings(offset_sigma_m=0.0, label_sigma_m=0.0, sightings_min=3),
    )
    return simulate_campus(SEED, with_known_signatures(settings))

"""A campus of a few streets: half a minute of work for the whole command instead of two."""

from pathlib import Path

from trigpoint_vehicle.app import Written, write_conversion
from trigpoint_vehicle.core.campus import conversion_of, simulate_campus
from trigpoint_vehicle.core.campus_settings import (
    CampusSettings,
    CarParkSettings,
    GnssSettings,
    ImagerySettings,
    ImuSettings,
    LandmarkSettings,
    MultipathSettings,
    RouteSettings,
    StreetSettings,
    SweepSettings,
    WheelSettings,
)

SEED = 1
LABELS = 15


def small_settings() -> CampusSettings:
    """450 by 300 m, drives of three to four minutes, sensors at a fifth of their rates."""
    return CampusSettings(
        wheels=WheelSettings(rate_hz=10.0),
        imu=ImuSettings(rate_hz=20.0),
        sweeps=SweepSettings(rate_hz=3.0),
        streets=StreetSettings(width_m=450.0, height_m=300.0, junction_jitter_m=4.0),
        landmarks=LandmarkSettings(pole_count=110, corner_count=20, pair_count=3),
        route=RouteSettings(
            length_min_m=900.0,
            length_max_m=1700.0,
            coverage_min=0.4,
            shared_min=0.3,
            shared_max=0.95,
            revisited_min=0.0,
        ),
        gnss=GnssSettings(
            multipath=MultipathSettings(count=1), car_park=CarParkSettings(duration_s=30.0, coherent_s=8.0)
        ),
        imagery=ImagerySettings(
            columns=2,
            rows=1,
            labels_in_quadrangle=8,
            labels_beside_it=4,
            labels_elsewhere=LABELS - 12,
            beside_distance_m=80.0,
            sightings_min=6,
        ),
    )


def write_small_campus(folder: Path, settings: CampusSettings | None = None) -> Written:
    """Its vehicles' logs, truth and anchors."""
    return write_conversion(conversion_of(simulate_campus(SEED, settings or small_settings())), folder)

"""Landmarks of the map, and a receiver's position, as relocalisation takes them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trigpoint.client.core.constellations import Constellation
from trigpoint.client.core.motion_fit import Expectation, PositionPrior
from trigpoint.client.core.relocalisation import REACH
from trigpoint.errors import InputError
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84
from trigpoint.geodesy.uncertainty import floored_covariance
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.queries import MAX_RADIUS_M, Disc

VARIANCE_FLOOR_M2 = 1e-6  # a millimetre: no landmark is known better
EXPECTED = Expectation(clutter_per_m2=5e-4, detected=0.7)  # one thing in 2,000 m^2 that is in no map: a street


@dataclass(frozen=True, slots=True, kw_only=True)
class GnssPrior:
    """What a receiver says: latitude and longitude in degrees, 1-sigma along each axis in m, and of the heading in the
    map (rad, counter-clockwise from grid east) what is known, None for nothing. Raises InputError for a sigma of 0."""

    lat_deg: float
    lon_deg: float
    sigma_m: float
    heading_rad: float | None = None
    heading_sigma_rad: float = np.inf

    def __post_init__(self) -> None:
        if not 0.0 < self.sigma_m < np.inf or not self.heading_sigma_rad > 0.0:
            raise InputError(f"sigma {self.sigma_m} m, of the heading {self.heading_sigma_rad} rad: both are above 0")


def position_prior(prior: GnssPrior, frame: MapFrame) -> PositionPrior:
    """The prior in the map frame."""
    (point_m,) = map_points_from_wgs84(np.array([prior.lat_deg]), np.array([prior.lon_deg]), frame)
    return PositionPrior(
        point_m=point_m,
        sigma_m=prior.sigma_m,
        heading_rad=prior.heading_rad,
        heading_sigma_rad=prior.heading_sigma_rad,
    )


def area_around(prior: GnssPrior, observed: Constellation) -> Disc:
    """Where landmarks may be that are observed. Raises InputError for a prior wider than a map."""
    farthest_m = float(np.hypot(*observed.point_m.T).max(initial=0.0))
    radius_m = 1.01 * (REACH * prior.sigma_m + farthest_m)  # a grid's metre is not quite one on the ground
    if radius_m > MAX_RADIUS_M:
        raise InputError(f"sigma {prior.sigma_m} m: landmarks up to {radius_m:.0f} m away, over {MAX_RADIUS_M:g} m")
    return Disc(lat_deg=prior.lat_deg, lon_deg=prior.lon_deg, radius_m=radius_m)


def known_constellation(landmarks: Sequence[Landmark]) -> Constellation:
    """Landmarks in the map frame."""
    covariances = [floored_covariance(row.covariance_m2, floor=VARIANCE_FLOOR_M2) for row in landmarks]
    return Constellation(
        point_m=np.array([(row.x_m, row.y_m) for row in landmarks], dtype=np.float64).reshape(-1, 2),
        covariance_m2=np.array(covariances, dtype=np.float64).reshape(-1, 2, 2),
        kind=tuple(row.kind for row in landmarks),
    )


def on_grid(observed: Constellation, frame: MapFrame) -> Constellation:
    """Observations in metres of the map's grid instead of metres on the ground."""
    scale = frame.point_scale
    return replace(observed, point_m=scale * observed.point_m, covariance_m2=scale**2 * observed.covariance_m2)

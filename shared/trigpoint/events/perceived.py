"""What perception found in the sweeps of a lidar. Writer: perception."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class PerceivedLandmark:
    """One landmark of one sweep, in the base frame at the sweep's stamp: x ahead, y left, in m.

    `kind` is what the map knows it as, "pole" or "corner" as in LandmarkDetection; `landmark_class` what it looks
    like: "pole", "trunk", "sign" or "corner". `track` numbers the thing itself within its drive and sensor.
    The covariance of x and y by its three numbers, in m^2. `height_m` of its seen top above the ground; `diameter_m`
    NaN for a corner; `points` that hit it.
    """

    kind: str
    landmark_class: str
    track: int
    x_m: float
    y_m: float
    variance_x_m2: float
    covariance_xy_m2: float
    variance_y_m2: float
    height_m: float
    diameter_m: float
    points: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarksPerceived:
    """What perception made of one sweep: its landmarks, possibly none, or why it was not usable (`refusal`, else
    empty). `sweep_sequence` is the PointsScanned's in its vehicle's boot; the event's stamp is the sweep's.
    """

    vehicle: str
    boot_id: str
    sensor: str
    sweep_sequence: int
    refusal: str
    landmarks: tuple[PerceivedLandmark, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryMatched:
    """How the base moved from one sweep to a later one, by matching points; the event's stamp is the later one's.

    x, y in m and heading in rad of the base at the later stamp in the base frame at `from_stamp_ns`;
    covariance (3, 3) of the three. `matched_share` of the points that found a partner.
    """

    vehicle: str
    boot_id: str
    sensor: str
    from_sequence: int
    from_stamp_ns: int
    sweep_sequence: int
    x_m: float
    y_m: float
    heading_rad: float
    covariance: NDArray[np.float64]
    matched_share: float


Perceived = LandmarksPerceived | OdometryMatched

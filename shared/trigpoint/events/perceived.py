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


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopClosed:
    """A place known again: where the base was at one sweep, as seen from where a base was at another, of the same drive
    long before or of another drive; proposed by landmarks and verified by points. The event's stamp is the one's.

    x, y in m and heading in rad of the one's base in the base frame at the other sweep; covariance (3, 3) of the three.
    `matched_share` of the upright points that lie on the other's; `pairs`: landmarks that proposed it.
    """

    vehicle: str
    boot_id: str
    sensor: str
    sweep_sequence: int
    other_vehicle: str
    other_boot_id: str
    other_sensor: str
    other_sequence: int
    other_stamp_ns: int
    x_m: float
    y_m: float
    heading_rad: float
    covariance: NDArray[np.float64]
    matched_share: float
    pairs: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SoughtDrive:
    """A drive in which a place was sought."""

    vehicle: str
    boot_id: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RefusedLoops:
    """How many proposals were refused for a reason."""

    reason: str
    count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopsSought:
    """A drive's places were sought among those of some drives, possibly itself: how many places landmarks proposed, how
    many of these points verified (each is a LoopClosed), and why the others were refused. It follows its LoopClosed."""

    vehicle: str
    boot_id: str
    among: tuple[SoughtDrive, ...]
    proposed: int
    verified: int
    refused: tuple[RefusedLoops, ...]


SweepPerceived = LandmarksPerceived | OdometryMatched  # told sweep by sweep
Perceived = SweepPerceived | LoopClosed | LoopsSought

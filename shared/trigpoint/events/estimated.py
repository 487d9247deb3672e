"""What the filter said of each fix and of the pose. Writer: filtering."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class FixJudged:
    """The filter's verdict on one fix. `nis` is the normalised innovation squared (2 degrees of freedom),
    `limit` the gate it was held against, `reason` one of "inside gate", "outside gate", "outage",
    "re-acquired", "initialised", and, where no gate was asked (`nis` and innovation NaN), "not initialised",
    "late"; `fix_sequence` the fix's sequence in its vehicle's boot.
    """

    vehicle: str
    boot_id: str
    fix_sequence: int
    accepted: bool
    reason: str
    nis: float
    limit: float
    innovation_x_m: float
    innovation_y_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseFiltered:
    """The filter's pose of a vehicle's base in the map frame.

    covariance (3, 3): x, y in m, heading in rad. `speed_mps` of the base.
    """

    vehicle: str
    boot_id: str
    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    covariance: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class GateAlarmed:
    """The gate can no longer do its work: it rejected everything, or could reject nothing, for `duration_s`."""

    vehicle: str
    boot_id: str
    reason: str
    duration_s: float


Estimated = FixJudged | PoseFiltered | GateAlarmed

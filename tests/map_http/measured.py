"""What a log holds of drives, kept in memory."""

from collections.abc import Sequence

import numpy as np

from landmark_maps.examples import START_NS, frame
from trigpoint.geodesy.projection import MapFrame
from trigpoint_landmarks.http.ports import DrivenPath, JudgedFix, PathSource

STEPS = 5_000
FIXES = 6_000


class MemoryDrives:
    """MeasuredDrives: two drives along arcs, one of a single pose, and fixes of which every third is refused."""

    def __init__(self) -> None:
        self.reads = 0

    def frame(self) -> MapFrame | None:
        return frame()

    def paths(self, source: PathSource) -> Sequence[DrivenPath]:
        self.reads += 1
        along = np.linspace(0.0, 60.0 * np.pi, STEPS)
        radius_m = 100.0 if source == "odometry" else 101.0
        arc_m = np.column_stack([radius_m * np.cos(along) + along, radius_m * np.sin(along)])
        stamp_ns = START_NS + np.arange(STEPS, dtype=np.int64) * 100_000_000
        return (
            DrivenPath(vehicle="veh-a", boot_id="b1", stamp_ns=stamp_ns, point_m=arc_m),
            DrivenPath(vehicle="veh-b", boot_id="b1", stamp_ns=stamp_ns[:1], point_m=arc_m[:1]),
            DrivenPath(vehicle="veh-c", boot_id="b2", stamp_ns=stamp_ns[:3], point_m=arc_m[:3]),
        )

    def fixes(self) -> Sequence[JudgedFix]:
        return [self._fix(number) for number in range(FIXES)]

    def _fix(self, number: int) -> JudgedFix:
        accepted = number % 3 != 0
        return JudgedFix(
            vehicle="veh-a",
            boot_id="b1",
            fix_sequence=number,
            stamp_ns=START_NS + number,
            lat_deg=-33.89 + number * 1e-6,
            lon_deg=151.18,
            sigma_m=None,
            accepted=accepted,
            reason="inside gate" if accepted else "outside gate",
            nis=1.0 if accepted else 25.0,
            limit=5.99,
            innovation_x_m=0.5,
            innovation_y_m=-0.5,
        )

"""How fixes of a drive that has a place enter the growing graph: some of them, under an error that changes slowly."""

import numpy as np

from trigpoint.events.observed import VehicleDescribed
from trigpoint.geodesy.poses import transform_points
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84
from trigpoint_optimisation.core.incremental import IncrementalGraph
from trigpoint_optimisation.core.live_leg import HungFix
from trigpoint_optimisation.core.live_placing import LocalFix
from trigpoint_optimisation.core.live_state import DriveInMap
from trigpoint_optimisation.settings import HONEST_EDGES

FIX_SPACING_NS = 2_000_000_000  # between fixes in the graph
FIX_KNOT_NS = 30_000_000_000  # the slow error of fixes is held for so long,
FIX_DECAY = float(np.exp(-30.0 / HONEST_EDGES.bias_time_s))  # and decays from one to the next by this


def local_fix(fix: HungFix, described: VehicleDescribed, frame: MapFrame, *, keyframe: int) -> LocalFix | None:
    """A fix hung on a keyframe, in the map; None where the map's projection does not reach."""
    fix_m = map_points_from_wgs84(np.array([fix.lat_deg]), np.array([fix.lon_deg]), frame)[0]
    if not np.isfinite(fix_m).all():
        return None
    arm = frame.point_scale * np.array([described.antenna_x_m, described.antenna_y_m])
    return LocalFix(keyframe=keyframe, fix_m=fix_m, antenna_m=transform_points(fix.T_keyframe_base, arm))


def hang_fix(graph: IncrementalGraph, drive: DriveInMap, fix: LocalFix, stamp_ns: int) -> None:
    """A fix in the graph, unless it comes too soon after the one before or from the same keyframe."""
    if fix.keyframe <= drive.last_fix_keyframe or stamp_ns < drive.last_fix_ns + FIX_SPACING_NS:
        return
    drive.last_fix_keyframe, drive.last_fix_ns = fix.keyframe, stamp_ns
    if drive.knot < 0 or stamp_ns >= drive.knot_ns + FIX_KNOT_NS:
        drive.knot, drive.knot_ns = drive.knot + 1, stamp_ns
        graph.add_fix_error(drive.index, drive.knot, sigma_m=HONEST_EDGES.bias_sigma_m, decay=FIX_DECAY)
    graph.add_fix(drive.index, fix.keyframe, drive.knot, fix.fix_m, antenna_m=fix.antenna_m, fixes=HONEST_EDGES)

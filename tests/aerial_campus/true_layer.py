"""The ortho layer as it would be if the paths were known exactly."""

from pathlib import Path

import numpy as np

from trigpoint.events.mapped import TrajectorySolved
from trigpoint.events.truth import TruthPath, truth_from_lines
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.readings import logged_frame, logged_maps
from trigpoint_tiles.clouds import logged_clouds
from trigpoint_tiles.core.grid import box_of, projected_grid
from trigpoint_tiles.geotiff import write_cog
from trigpoint_tiles.grid_layer import GridLayer
from trigpoint_tiles.settings import TilesSettings

SIGMA_M, SIGMA_RAD = 1e-3, 1e-4  # of what is known exactly; covariances of nothing are none


def render_true_layer(log_folder: Path, truth: Path, out: Path, settings: TilesSettings) -> None:
    """The drives of a log's newest map version by their true paths, as a COG in the map's CRS."""
    with truth.open(encoding="utf-8") as lines:
        paths = {path.vehicle: path for path in truth_from_lines(lines).paths}
    log = McapLog(log_folder)
    try:
        frame = logged_frame(log)
        *_, solved = logged_maps(log)
        exact = tuple(_exactly(one, paths[one.vehicle], frame) for one in solved.trajectories)
        grid = projected_grid(frame.crs, resolution_m=settings.resolution_m)
        layer = GridLayer(out.with_suffix(".work"), frame, grid, settings)
        found = layer.bring_up(log, logged_clouds(log, exact), progress=lambda count: None)
        write_cog(out, grid, box_of(found.tiles), layer.all_bands(found.tiles), tags={"MAP_VERSION": "0"})
    finally:
        log.close()


def _exactly(solved: TrajectorySolved, path: TruthPath, frame: MapFrame) -> TrajectorySolved:
    point_m = map_points_from_wgs84(path.lat_deg, path.lon_deg, frame)
    return TrajectorySolved(
        map_version=solved.map_version,
        vehicle=solved.vehicle,
        boot_id=solved.boot_id,
        stamp_ns=path.stamp_ns,
        pose=np.column_stack([point_m, path.heading_rad]),
        covariance=np.tile(np.diag([SIGMA_M**2, SIGMA_M**2, SIGMA_RAD**2]), (len(point_m), 1, 1)),
        calibration=(),
    )

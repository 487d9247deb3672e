"""A served map read by QGIS's own OGC API provider: what is missing, and how far the worst one is from its place."""

import math
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from command_runs.running import trigpoint
from landmark_maps.examples import change, checkpoint
from map_features.examples import crowd
from map_http.served import geopackage_line, served_map
from qgis_reading.project import seen
from trigpoint.landmarks.geopackage_store import GeoPackageStore

AROUND_M = (331_800.0, 6_247_850.0, 332_300.0, 6_248_250.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadByQgis:
    """Landmarks not read, and how far from its place the worst one is."""

    missing: int
    off_m: float


def read_by_qgis(folder: Path) -> ReadByQgis:
    """The landmarks of a served map as a project of it shows them."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = {row.landmark: row for row in crowd()}
    path, project = folder / "map.gpkg", folder / "live.qgz"
    with closing(GeoPackageStore(path)) as store:
        store.apply(change(1, opened=list(rows.values())), checkpoint(1))
    with served_map(folder, database=geopackage_line(path)) as served:
        run = trigpoint("export", "qgis", "--server", served.url, "--out", project, "--force")
        assert run.status == 0, run.err
        found = seen(project, folder / "live.png", AROUND_M).points_m("Landmarks")
    off_m = (math.dist(found[name], (row.easting_m, row.northing_m)) for name, row in rows.items() if name in found)
    return ReadByQgis(missing=len(rows.keys() - found.keys()), off_m=max(off_m, default=math.inf))

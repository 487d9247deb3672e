"""`python -m figures --only victoria-park`: one JSON object a line, status 1 if a figure could not be measured."""

import argparse
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from figures import (
    billion,
    campus,
    demo,
    faults_ingest,
    faults_link,
    faults_log,
    faults_postgis,
    faults_services,
    http,
    ingest,
    lidar_campus,
    lidar_closures,
    lidar_found,
    lidar_kitti,
    lidar_points,
    live,
    mrclam,
    nclt,
    ortho,
    ortho_aerial,
    ortho_anew,
    projection,
    query,
    raster_readers,
    relocalise,
    scale,
    security,
    security_fuzz,
    victoria_park,
    viewer,
)
from figures.figure import Figure, json_line, measured_lines
from figures.workbench import Workbench

GROUPS: Mapping[str, Sequence[Figure]] = {
    "victoria-park": victoria_park.FIGURES,
    "mrclam": mrclam.FIGURES,
    "nclt": nclt.FIGURES,
    "campus": campus.FIGURES,
    "demo": demo.FIGURES,
    "faults": (
        *faults_ingest.FIGURES,
        *faults_link.FIGURES,
        *faults_log.FIGURES,
        *faults_postgis.FIGURES,
        *faults_services.FIGURES,
    ),
    "ingest": (*ingest.FIGURES, *projection.FIGURES),
    "lidar": (
        *lidar_kitti.FIGURES,
        *lidar_found.FIGURES,
        *lidar_campus.FIGURES,
        *lidar_points.FIGURES,
        *lidar_closures.FIGURES,
    ),
    "lidar-demo": lidar_points.DEMO_FIGURES,
    "live": live.FIGURES,
    "query": query.FIGURES,
    "http": http.FIGURES,
    "viewer": viewer.FIGURES,
    "ortho": (*ortho.FIGURES, *ortho_aerial.FIGURES, *ortho_anew.FIGURES, *raster_readers.FIGURES),
    "relocalise": relocalise.FIGURES,
    "scale": (*scale.FIGURES, *billion.FIGURES),
    "security": (*security.FIGURES, *security_fuzz.FIGURES),
}
PROGRAM = (str(Path(sys.executable).with_name("trigpoint")),)


def chosen_groups(only: str | None) -> list[str]:
    """The groups named, separated by commas, or all. Raises ValueError for one that is not there."""
    names = list(GROUPS) if only is None else only.split(",")
    unknown = [name for name in names if name not in GROUPS]
    if unknown:
        raise ValueError(f"no figures are called {', '.join(unknown)}: there are {', '.join(GROUPS)}")
    return names


def main(words: Sequence[str]) -> int:
    """The exit status after writing every chosen figure."""
    parser = argparse.ArgumentParser(prog="figures")
    parser.add_argument("--only", metavar="GROUP[,GROUP]", help=f"some of {', '.join(GROUPS)}")
    parser.add_argument("--drives", type=Path, required=True, help="folder of recorded drives")
    options = parser.parse_args(words)
    try:
        groups = chosen_groups(options.only)
    except ValueError as error:
        parser.error(str(error))
    unmeasured = 0
    for group in groups:
        with tempfile.TemporaryDirectory(prefix=f"trigpoint-{group}-") as folder:
            bench = Workbench(Path(folder), options.drives, PROGRAM)
            for row in measured_lines(group, GROUPS[group], bench):
                unmeasured += "error" in row
                sys.stdout.write(json_line(row) + "\n")
                sys.stdout.flush()
    return 1 if unmeasured else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""A PostGIS database of 200,000 landmarks, and requests for parts of it."""

from collections.abc import Iterator
from contextlib import closing, contextmanager

import numpy as np

from landmark_databases.cluster import Cluster, running_cluster
from landmark_maps.examples import change, checkpoint, frame, solved_landmark
from trigpoint.events.solved_landmarks import in_columns
from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.web_tiles import tile_at
from trigpoint.landmarks.postgis_store import PostgisStore
from trigpoint_landmarks.core.rows import landmark_rows

COUNT = 200_000
SIDE_M = 14_142.0  # a landmark on 1 000 m^2
BOX_M = 158.0  # a box that holds 25
MARGIN_M = 200.0
SEED = 7
PROPERTIES = (
    "landmark,kind,signature,x_m,y_m,variance_x_m2,covariance_xy_m2,variance_y_m2,sigma_major_m,sigma_minor_m,"
    "ellipse_heading_rad,observation_count,vehicles,first_seen_ns,last_seen_ns,anchored,anchors,valid_from_version,"
    "valid_to_version"
)
TILE_PROPERTIES = "landmark,kind,sigma_major_m,sigma_minor_m,ellipse_heading_rad,observation_count,anchored"
WEST_DEG, EAST_DEG, SOUTH_DEG, NORTH_DEG = 151.187, 151.330, -33.890, -33.775  # within the map
METRES_LAT, METRES_LON = 110_900.0, 92_200.0  # of a degree there


@contextmanager
def crowded_cluster() -> Iterator[tuple[Cluster, str]]:
    """A server with the map in it, and the database's name; PostgreSQL's clients know the password."""
    points_m = np.random.default_rng(SEED).uniform(0.0, SIDE_M, (COUNT, 2)).tolist()
    solved = [solved_landmark(f"L{n}", x_m, y_m) for n, (x_m, y_m) in enumerate(points_m)]
    rows = landmark_rows(in_columns(solved), frame())
    with running_cluster(durable=False) as cluster, cluster.password_known():
        database = cluster.created()
        with closing(PostgisStore(cluster.url(database))) as store:
            store.defer_indexes()
            store.apply(change(1, opened=rows), checkpoint(1))
            store.restore_indexes()
        yield cluster, database


def boxes(count: int) -> list[str]:
    """Boxes at random, as the parameter has them."""
    random = np.random.default_rng(SEED)
    lon_deg, lat_deg = random.uniform(WEST_DEG, EAST_DEG, count), random.uniform(SOUTH_DEG, NORTH_DEG, count)
    east_deg, north_deg = BOX_M / METRES_LON, BOX_M / METRES_LAT
    return [
        f"{lon:.7f},{lat:.7f},{lon + east_deg:.7f},{lat + north_deg:.7f}"
        for lon, lat in zip(lon_deg.tolist(), lat_deg.tolist(), strict=True)
    ]


def tiles(zoom: int) -> list[str]:
    """All tiles of a zoom within the map, each as z/x/y, row by row."""
    low = tile_at(Wgs84Position(NORTH_DEG, WEST_DEG), zoom)
    high = tile_at(Wgs84Position(SOUTH_DEG, EAST_DEG), zoom)
    return [
        f"{zoom}/{column}/{row}"
        for row in range(low.row, high.row + 1)
        for column in range(low.column, high.column + 1)
    ]

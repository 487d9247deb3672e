"""The landmark database as GDAL and SQLite see it: right CRS, right place, every row."""

import sqlite3
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyogrio
import pytest
import shapely
from sqlalchemy import text

from landmark_maps.examples import ORIGIN, change, checkpoint, landmark, solved_landmark, version_row, whole_change
from trigpoint.events.envelope import LogPosition
from trigpoint.events.solved_landmarks import in_columns
from trigpoint.geodesy.positions import GridPosition
from trigpoint.geodesy.projection import pin_map_frame
from trigpoint.landmarks import tables
from trigpoint.landmarks.geopackage_file import close, opened
from trigpoint.landmarks.geopackage_geometry import encoded_point
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.model import Checkpoint
from trigpoint_landmarks.core.rows import landmark_rows

LAYERS = {
    "landmarks": "Point",
    "landmark_history": "Point",
    "trajectories": "LineString",
    "anchors": "Point",
    "current_trajectories": "LineString",
    "current_anchors": "Point",
    "map_versions": None,
    "image_offsets": None,
    "label_gains": None,
    "log_checkpoints": None,
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A database with something in every table, and two versions."""
    path = tmp_path / "landmarks.gpkg"
    store = GeoPackageStore(path)
    store.apply(whole_change(), checkpoint(6))
    store.apply(change(2, opened=[landmark("L2", 10.0, 20.0), landmark("L1", 2.0, 3.0)], closed=["L1"]), checkpoint(12))
    store.close()
    return path


@pytest.fixture
def database(path: Path) -> Iterator[sqlite3.Connection]:
    connection = sqlite3.connect(path)
    yield connection
    connection.close()


def test_gdal_lists_every_layer_with_its_geometry(path: Path) -> None:
    assert dict(pyogrio.list_layers(path)) == LAYERS


@pytest.mark.parametrize("layer", [name for name, kind in LAYERS.items() if kind])
def test_gdal_knows_the_crs_of_every_layer(path: Path, layer: str) -> None:
    assert pyogrio.read_info(path, layer=layer)["crs"] == "EPSG:32756"


@pytest.mark.parametrize(
    ("layer", "count"),
    [("landmarks", 2), ("landmark_history", 1), ("trajectories", 1), ("anchors", 2), ("current_anchors", 0)],
)
def test_gdal_counts_every_row(path: Path, layer: str, count: int) -> None:
    assert pyogrio.read_info(path, layer=layer, force_feature_count=True)["features"] == count


def test_gdal_reads_a_landmark_where_it_stands(path: Path) -> None:
    meta, _, wkb, values = pyogrio.raw.read(path, layer="landmarks", columns=["landmark", "x_m"])
    points = {str(name): shapely.from_wkb(point) for name, point in zip(values[0], wkb, strict=True)}
    assert (points["L2"].x, points["L2"].y) == (ORIGIN.easting_m + 10.0, ORIGIN.northing_m + 20.0)
    assert list(meta["fields"]) == ["landmark", "x_m"]


def test_gdal_reads_every_column_of_a_landmark(path: Path) -> None:
    read = set(pyogrio.read_info(path, layer="landmarks")["fields"])
    assert read == {column.name for column in tables.landmarks.columns} - {"fid", "geom"}


def test_gdal_reads_nanoseconds_whole(path: Path) -> None:
    *_, values = pyogrio.raw.read(path, layer="landmarks", columns=["first_seen_ns"])
    assert values[0].tolist() == [1_700_000_000_000_000_000] * 2


def test_gdal_finds_landmarks_by_a_box_on_the_grid(path: Path) -> None:
    x_m, y_m = ORIGIN.easting_m + 10.0, ORIGIN.northing_m + 20.0
    *_, values = pyogrio.raw.read(path, layer="landmarks", bbox=(x_m - 1, y_m - 1, x_m + 1, y_m + 1))
    assert values[0].tolist() == ["L2"]


def test_gdal_transforms_to_the_degrees_the_row_holds(path: Path) -> None:
    wgs84 = "ST_Transform(geom, 4326)"
    sql = f"SELECT ST_X({wgs84}) AS lon, ST_Y({wgs84}) AS lat, lon_deg, lat_deg FROM landmarks"
    *_, (lon, lat, lon_deg, lat_deg) = pyogrio.raw.read(path, sql=sql, sql_dialect="SQLITE", read_geometry=False)
    # GDAL has a PROJ of its own: 1e-9 degrees are 0.1 mm.
    assert np.abs(lon - lon_deg).max() < 1e-9
    assert np.abs(lat - lat_deg).max() < 1e-9


def test_a_crs_without_an_authority_is_placed_by_its_definition(tmp_path: Path) -> None:
    local = "+proj=tmerc +lat_0=-33.9 +lon_0=151.2 +k=1 +x_0=5000 +y_0=5000 +ellps=GRS80 +towgs84=0,0,0 +units=m"
    (row,) = landmark_rows(
        in_columns([solved_landmark("L1", 1.0, 2.0)]), pin_map_frame(crs=local, origin=GridPosition(5e3, 5e3))
    )
    version = replace(version_row(), crs=local, origin_easting_m=5e3, origin_northing_m=5e3)
    store = GeoPackageStore(tmp_path / "local.gpkg")
    store.apply(replace(change(1, opened=[row]), version=version), checkpoint(1))
    store.close()
    info = pyogrio.read_info(tmp_path / "local.gpkg", layer="landmarks")
    assert "Transverse_Mercator" in info["crs"]
    # 1 m east and 2 m north of the projection's centre; a degree of latitude is 110.92 km there, one of longitude
    # 92.50 km; 1e-7 degrees are 1 cm.
    assert (row.lat_deg, row.lon_deg) == pytest.approx((-33.9 + 2 / 110_920, 151.2 + 1 / 92_500), abs=1e-7)


def test_sqlite_finds_the_file_and_its_indexes_sound(path: Path) -> None:
    store = GeoPackageStore(path, read_only=True)
    assert store.damage() == ()
    store.close()


def test_the_header_says_geopackage_1_4(database: sqlite3.Connection) -> None:
    assert database.execute("PRAGMA application_id").fetchone() == (0x47504B47,)
    assert database.execute("PRAGMA user_version").fetchone() == (10400,)
    assert database.execute("PRAGMA foreign_key_check").fetchall() == []


def test_the_indexes_are_registered_as_the_extension_they_are(database: sqlite3.Connection) -> None:
    rows = database.execute("SELECT table_name, column_name, extension_name, scope FROM gpkg_extensions").fetchall()
    layers = ("landmarks", "landmark_history", "trajectories", "anchors")
    assert rows == [(layer, "geom", "gpkg_rtree_index", "write-only") for layer in layers]


def test_the_layers_say_how_far_they_reach(database: sqlite3.Connection) -> None:
    sql = "SELECT min_x, min_y, max_x, max_y FROM gpkg_contents WHERE table_name = 'landmarks'"
    box = database.execute(sql).fetchone()
    # The index keeps float32, rounded outwards: 0.5 m at a northing of 6 248 000 m.
    assert box == pytest.approx((332_002.0, 6_248_003.0, 332_010.0, 6_248_020.0), abs=0.51)


def test_no_column_is_of_a_type_gdal_does_not_know(database: sqlite3.Connection) -> None:
    declared = {
        row[2] for table in tables.metadata.tables for row in database.execute(f"PRAGMA table_info({table})").fetchall()
    }
    assert declared == {"INTEGER", "TEXT", "REAL", "BOOLEAN", "POINT", "LINESTRING"}


def test_the_same_versions_give_the_same_bytes(tmp_path: Path) -> None:
    written = []
    for name in ("first.gpkg", "second.gpkg"):
        store = GeoPackageStore(tmp_path / name)
        store.apply(whole_change(), Checkpoint().after(LogPosition("optimisation", 5)))
        store.close()
        written.append((tmp_path / name).read_bytes())
    assert written[0] == written[1]


def test_a_landmark_dragged_in_a_gis_is_found_where_it_went(path: Path) -> None:
    connection = opened(path, read_only=False)
    there = encoded_point(ORIGIN.easting_m + 500.0, ORIGIN.northing_m + 500.0, srs_id=32756)
    connection.execute(text("UPDATE landmarks SET geom = :there WHERE landmark = 'L2'"), {"there": there})
    found = connection.execute(text("SELECT minx, maxy FROM rtree_landmarks_geom ORDER BY maxy DESC LIMIT 1")).one()
    close(connection)
    # The index keeps float32, rounded outwards: 0.5 m at this northing.
    assert tuple(found) == pytest.approx((332_500.0, 6_248_500.0), abs=0.51)


def test_a_landmark_deleted_in_a_gis_leaves_the_index(path: Path) -> None:
    connection = opened(path, read_only=False)
    connection.execute(text("DELETE FROM landmarks"))
    assert connection.scalar(text("SELECT count(*) FROM rtree_landmarks_geom")) == 0
    close(connection)

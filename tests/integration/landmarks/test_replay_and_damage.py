"""The database is a projection: rebuilt it is equal, and whatever happened to the file is found and said."""

import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from landmark_maps.examples import (
    append_labels,
    append_mapped,
    change,
    checkpoint,
    label,
    landmark,
    pin_frame,
    solved_landmark,
    solved_map,
    whole_change,
)
from trigpoint.errors import InputError, ServiceError
from trigpoint.landmarks.geopackage_file import driver_of
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.queries import Disc, LandmarkQuery
from trigpoint.logs.memory_log import MemoryLog
from trigpoint_landmarks.app import project, replay_difference
from trigpoint_landmarks.core.comparison import RowDifference


@pytest.fixture
def log() -> MemoryLog:
    """A log of two versions: L1 stays, L2 moves, L3 comes."""
    log = MemoryLog()
    pin_frame(log)
    append_labels(log, [label("anchor-1"), label("anchor-2")])
    append_mapped(log, solved_map(1, [solved_landmark("L1", 0.0, 0.0), solved_landmark("L2", 9.0, 0.1)], labels=2))
    landmarks = [solved_landmark(f"L{n}", x_m, 0.0, map_version=2) for n, x_m in ((1, 0.0), (2, 9.5), (3, 20.0))]
    append_mapped(log, solved_map(2, landmarks, labels=2))
    return log


@pytest.fixture
def path(log: MemoryLog, tmp_path: Path) -> Path:
    """The database of that log."""
    path = tmp_path / "landmarks.gpkg"
    store = GeoPackageStore(path)
    project(log, store)
    store.close()
    return path


def difference(log: MemoryLog, path: Path) -> tuple[RowDifference, ...]:
    """What replaying finds wrong with a file."""
    with closing(GeoPackageStore(path, read_only=True)) as held:
        return replay_difference(log, held)


def tampered(path: Path, sql: str) -> None:
    """The file after an edit that went past the store, and past its triggers."""
    connection = sqlite3.connect(path)
    for (trigger,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
        connection.execute(f"DROP TRIGGER {trigger}")
    connection.execute(sql)
    connection.commit()
    connection.close()


def test_a_replay_differs_in_nothing(log: MemoryLog, path: Path) -> None:
    assert difference(log, path) == ()


def test_a_replay_only_reads_the_database(log: MemoryLog, path: Path) -> None:
    before = path.read_bytes()
    difference(log, path)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("sql", "expected"),
    [
        (
            "UPDATE landmarks SET x_m = 9.25 WHERE landmark = 'L2'",
            ("landmarks", "L2 from version 2", "x_m 9.25 instead of 9.5"),
        ),
        (
            "UPDATE landmark_history SET valid_to_version = 3",
            ("landmarks", "L2 from version 1", "valid_to_version 3 instead of 2"),
        ),
        (
            "DELETE FROM trajectories WHERE map_version = 1",
            ("trajectories", "veh-a/boot-1 of version 1", "missing in the database"),
        ),
        (
            "UPDATE anchors SET residual_x_m = NULL",
            ("anchors", "anchor-1 in tile-1 of version 1", "residual_x_m None instead of 0.3"),
        ),
        ("UPDATE image_offsets SET image = 'x'", ("image_offsets", "tile-1 of version 1", "missing in the database")),
        ("UPDATE map_versions SET method = 'loose'", ("map_versions", "1", "method 'loose' instead of 'anchored'")),
        (
            "UPDATE log_checkpoints SET next_number = 3",
            ("log_checkpoints", "optimisation", "next_number 3 instead of 15"),
        ),
    ],
)
def test_whatever_was_changed_is_named(log: MemoryLog, path: Path, sql: str, expected: tuple[str, str, str]) -> None:
    tampered(path, sql)
    assert RowDifference(*expected) in difference(log, path)


def test_a_row_the_log_never_had_is_named(log: MemoryLog, path: Path) -> None:
    tampered(path, "UPDATE landmarks SET landmark = 'X' WHERE landmark = 'L3'")
    assert RowDifference("landmarks", "X from version 2", "not in the log") in difference(log, path)


def test_a_geometry_apart_from_its_columns_is_named(log: MemoryLog, path: Path) -> None:
    tampered(path, "UPDATE landmarks SET geom = (SELECT geom FROM landmarks WHERE landmark = 'L3')")
    assert {difference.key for difference in difference(log, path)} >= {"L1 from version 1", "L2 from version 2"}


def test_an_index_apart_from_its_table_is_named(log: MemoryLog, path: Path) -> None:
    tampered(path, "DELETE FROM rtree_landmarks_geom_rowid")
    assert "file" in {difference.table for difference in difference(log, path)}


def test_a_database_behind_the_log_differs_by_what_it_lacks(log: MemoryLog, path: Path) -> None:
    append_mapped(log, solved_map(3, []))
    keys = {(difference.table, difference.key) for difference in difference(log, path)}
    assert {("log_checkpoints", "optimisation"), ("map_versions", "3"), ("landmarks", "L1 from version 1")} <= keys


def test_a_missing_database_is_refused(log: MemoryLog, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no landmark database at .*none.gpkg"):
        difference(log, tmp_path / "none.gpkg")


@pytest.mark.parametrize(
    "content", [b"not a database at all, but long enough to look", b"SQLite format 3\x00" + bytes(84)]
)
def test_a_file_that_is_no_database_is_refused_and_kept(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "landmarks.gpkg"
    path.write_bytes(content)
    with pytest.raises(
        InputError, match="landmarks.gpkg is not a sound database: file is not a database; delete it and replay"
    ):
        GeoPackageStore(path)
    assert path.read_bytes() == content


def test_another_sqlite_database_is_refused_by_its_application_id(tmp_path: Path) -> None:
    connection = sqlite3.connect(tmp_path / "other.gpkg")
    connection.execute("CREATE TABLE anything (a)")
    connection.close()
    with pytest.raises(InputError, match="application id 0x0 instead of 0x47504b47"):
        GeoPackageStore(tmp_path / "other.gpkg")


def test_a_database_of_another_program_version_is_refused_by_its_columns(path: Path) -> None:
    tampered(path, "ALTER TABLE image_offsets ADD COLUMN yaw_rad REAL")
    with pytest.raises(InputError, match="image_offsets has columns .*yaw_rad.* delete it and replay the log"):
        GeoPackageStore(path)


@pytest.mark.parametrize("share", [0.001, 0.1, 0.5, 0.9])
def test_a_truncated_database_is_refused_with_the_way_out(log: MemoryLog, path: Path, share: float) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match="landmarks.gpkg is not a sound database: .* delete it and replay the log"):
        difference(log, path)


@pytest.mark.parametrize(("text", "broken"), [(b'"veh-a/boot-1"', b'"veh-\xff/boot-1"'), (b'["veh-a"]', b"['veh-a'<")])
def test_a_text_that_can_no_longer_be_read_is_damage(log: MemoryLog, path: Path, text: bytes, broken: bytes) -> None:
    path.write_bytes(path.read_bytes().replace(text, broken))
    with pytest.raises(InputError, match="landmarks.gpkg is not a sound database: .* delete it and replay the log"):
        difference(log, path)


def test_a_flipped_bit_in_a_text_that_can_still_be_read_is_a_difference(log: MemoryLog, path: Path) -> None:
    path.write_bytes(path.read_bytes().replace(b'"veh-a/boot-1"', b'"veh-A/boot-1"'))
    assert "landmarks" in {difference.table for difference in difference(log, path)}


def test_an_empty_file_becomes_a_database(tmp_path: Path) -> None:
    (tmp_path / "landmarks.gpkg").touch()
    store = GeoPackageStore(tmp_path / "landmarks.gpkg")
    assert list(store.rows()) == []
    store.close()


def test_an_empty_file_that_may_only_be_read_is_refused(tmp_path: Path) -> None:
    (tmp_path / "landmarks.gpkg").touch()
    with pytest.raises(InputError, match="application id 0x0 instead of 0x47504b47"):
        GeoPackageStore(tmp_path / "landmarks.gpkg", read_only=True)


def test_a_full_disk_leaves_the_versions_before_as_they_were(path: Path) -> None:
    store = GeoPackageStore(path)
    before = set(store.rows())
    driver_of(store._connection).execute("PRAGMA max_page_count = 1")  # SQLite's own stand-in for a full disk
    crowd = [landmark(f"M{n}", float(n), 0.0) for n in range(2000)]
    with pytest.raises(ServiceError, match="database or disk is full"):
        store.apply(change(3, opened=crowd), checkpoint(99))
    assert set(store.rows()) == before
    store.close()


def test_a_version_a_reader_kept_waiting_too_long_is_taken_back(path: Path) -> None:
    store, reader = GeoPackageStore(path), sqlite3.connect(path)
    driver_of(store._connection).execute("PRAGMA busy_timeout = 0")
    reader.executescript("BEGIN; SELECT * FROM landmarks")  # a transaction that goes on holds its read lock
    with pytest.raises(ServiceError, match="database is locked"):
        store.apply(change(3), checkpoint(99))
    reader.close()
    store.apply(change(3), checkpoint(99))
    assert store.map_versions()[-1].map_version == 3
    store.close()


def test_a_folder_that_is_not_there_is_said_with_its_name(tmp_path: Path) -> None:
    with pytest.raises(ServiceError, match="nowhere.*unable to open database file"):
        GeoPackageStore(tmp_path / "nowhere" / "landmarks.gpkg")


DYING = """
import os, sys
from dataclasses import replace
from pathlib import Path
from landmark_maps.examples import change, checkpoint, landmark
from trigpoint.landmarks.geopackage_file import driver_of
from trigpoint.landmarks.geopackage_store import GeoPackageStore

class Killed(tuple):
    def __iter__(self):
        os.kill(os.getpid(), 9)

store = GeoPackageStore(Path(sys.argv[1]))
driver_of(store._connection).execute("PRAGMA cache_size = 5")  # pages: the version reaches the file before its commit
crowd = [landmark(f"M{n}", float(n), 0.0) for n in range(300)]
store.apply(replace(change(3, opened=crowd), image_offsets=Killed()), checkpoint(99))
"""


def test_a_kill_in_the_middle_of_a_version_leaves_no_part_of_it(log: MemoryLog, path: Path) -> None:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    killed = subprocess.run([sys.executable, "-c", DYING, str(path)], env=environment, timeout=60, check=False)
    assert killed.returncode == -9
    assert path.with_name(f"{path.name}-journal").stat().st_size > 0  # half a version is in the file, to be taken back
    assert difference(log, path) == ()


def test_a_reader_sees_a_version_another_process_writes(path: Path) -> None:
    reader, writer = GeoPackageStore(path, read_only=True), GeoPackageStore(path)
    far = landmark("far", 5_000.0, 5_000.0)
    query = LandmarkQuery(near=Disc(lat_deg=far.lat_deg, lon_deg=far.lon_deg, radius_m=1.0))
    assert reader.landmarks(query) == ()
    writer.apply(change(3, opened=[far]), checkpoint(99))
    assert [row.landmark for row in reader.landmarks(query)] == ["far"]
    reader.close()
    writer.close()


def test_a_reader_cannot_write(path: Path) -> None:
    reader = GeoPackageStore(path, read_only=True)
    with pytest.raises(ServiceError, match="readonly database"):
        reader.apply(whole_change(3), checkpoint(99))
    reader.close()

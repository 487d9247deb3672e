"""From the log on disk into the database on disk, and again: the same rows whatever the order of events."""

from pathlib import Path

from landmark_maps.examples import append_labels, append_mapped, label, pin_frame, solved_landmark, solved_map
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.memory_store import MemoryStore
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.ports import EventLog
from trigpoint_landmarks.app import project, replay_difference


def build_in_steps(log: EventLog, path: Path) -> None:
    """Two solves with a projection after each, and an anchor mended in between."""
    pin_frame(log)
    append_labels(log, [label("anchor-1"), label("anchor-2")])
    first = [solved_landmark(f"L{n}", 10.0 * n, 0.123456789 * n) for n in range(20)]
    append_mapped(log, solved_map(1, first, labels=2))
    projected(log, path)
    append_labels(log, [label("anchor-1", lat_deg=-33.8901)])
    second = [solved_landmark(f"L{n}", 10.0 * n, 0.123456789 * (n % 15), map_version=2) for n in range(5, 25)]
    append_mapped(log, solved_map(2, second, labels=3))
    projected(log, path)


def projected(log: EventLog, path: Path) -> None:
    store = GeoPackageStore(path)
    project(log, store)
    store.close()


def test_a_database_built_step_by_step_is_what_the_log_on_disk_replays(tmp_path: Path) -> None:
    log = McapLog(tmp_path / "log")
    build_in_steps(log, tmp_path / "landmarks.gpkg")
    log.close()
    reopened = McapLog(tmp_path / "log")
    held = GeoPackageStore(tmp_path / "landmarks.gpkg", read_only=True)
    assert replay_difference(reopened, held) == ()
    held.close()
    reopened.close()


def test_the_log_on_disk_and_its_twin_in_memory_make_the_same_rows(tmp_path: Path) -> None:
    on_disk, in_memory = McapLog(tmp_path / "log"), MemoryLog()
    build_in_steps(on_disk, tmp_path / "a.gpkg")
    build_in_steps(in_memory, tmp_path / "b.gpkg")
    stores = MemoryStore(), MemoryStore()
    project(on_disk, stores[0])
    project(in_memory, stores[1])
    assert set(stores[0].rows()) == set(stores[1].rows())
    on_disk.close()

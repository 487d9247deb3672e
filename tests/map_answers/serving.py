"""`python -m map_answers.serving answers|bare|moving …`: one side of a race as a process of its own.

It says "ready" on standard output, and works until standard input ends.
"""

import json
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import zenoh

from landmark_maps.examples import CRS, ORIGIN, START_NS, change, checkpoint, frame, landmark
from map_answers.answering import MAP, ROOT, answered
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings, session_config
from trigpoint.geodesy.projection import wgs84_from_map_points
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.memory_store import MemoryStore
from trigpoint.landmarks.model import Checkpoint, Landmark, MapChange
from trigpoint_landmarks.change_feed import ChangeFeed, FeedingStore

BARE_KEY = "bare/ask"
SIDE_M = 10_000.0  # of the square the landmarks lie in


def scattered(count: int, *, seed: int) -> list[Landmark]:
    """Landmarks at random in the square."""
    at_m = np.random.default_rng(seed).uniform(0.0, SIDE_M, (count, 2))
    lat_deg, lon_deg = wgs84_from_map_points(at_m, frame())
    like = landmark("", 0.0, 0.0)
    places = zip(at_m.tolist(), lat_deg.tolist(), lon_deg.tolist(), strict=True)
    return [
        like._replace(
            landmark=f"lm-{number:06}",
            x_m=x_m,
            y_m=y_m,
            easting_m=x_m + ORIGIN.easting_m,
            northing_m=y_m + ORIGIN.northing_m,
            lat_deg=lat,
            lon_deg=lon,
            provenance="",
        )
        for number, ((x_m, y_m), lat, lon) in enumerate(places)
    ]


class TimedStore(GeoPackageStore):
    """A store that remembers when each step was durable."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.durable_ns: list[int] = []

    def apply_all(self, changes: Sequence[MapChange], checkpoint: Checkpoint) -> None:
        """The versions applied, and the time it was done."""
        super().apply_all(changes, checkpoint)
        self.durable_ns.append(time.monotonic_ns())


def ready() -> None:
    """Whoever started this process goes on."""
    sys.stdout.write("ready\n")
    sys.stdout.flush()


def answers(endpoint: str, count: str) -> None:
    """The service with so many landmarks."""
    store = MemoryStore()
    store.apply(change(1, opened=scattered(int(count), seed=1), crs=CRS), checkpoint(1))
    with ZenohBus(ZenohSettings(listen=(endpoint,))) as bus, answered(store, bus):
        ready()
        sys.stdin.read()


def bare(endpoint: str, file: str) -> None:
    """A queryable that replies the same bytes to everything, as Zenoh's own example does it."""
    payload = Path(file).read_bytes()
    with zenoh.open(session_config(ZenohSettings(listen=(endpoint,)))) as session:
        queryable = session.declare_queryable(BARE_KEY, lambda query: query.reply(BARE_KEY, payload))
        ready()
        sys.stdin.read()
        queryable.undeclare()  # type: ignore[no-untyped-call]


def moving(endpoint: str, versions: str, pause_s: str) -> None:
    """A map of 2,000 landmarks of which ten move in each version; in the end says when each was durable."""
    rows, pause = scattered(2_000, seed=2), threading.Event()
    with tempfile.TemporaryDirectory() as folder, ZenohBus(ZenohSettings(listen=(endpoint,))) as bus:
        store, twin = TimedStore(Path(folder) / "map.gpkg"), MemoryStore()
        for one in (store, twin):
            one.apply(change(1, opened=rows), checkpoint(1))
        with answered(twin, bus), ChangeFeed(bus, root=ROOT, map_name=MAP) as feed:
            told = FeedingStore(store, feed)
            ready()
            sys.stdin.readline()
            for version in range(2, int(versions) + 2):
                moved = [row._replace(last_seen_ns=START_NS + version) for row in rows[version % 200 :: 200]]
                step = change(version, opened=moved, closed=[row.landmark for row in moved])
                twin.apply(step, checkpoint(version))
                told.apply(step, checkpoint(version))
                pause.wait(float(pause_s))
            sys.stdin.read()
        sys.stdout.write(json.dumps(store.durable_ns[1:]) + "\n")
        store.close()


def main(words: Sequence[str]) -> None:
    """The side of the race that is named."""
    sides = {"answers": answers, "bare": bare, "moving": moving}
    sides[words[0]](*words[1:])  # type: ignore[operator]


if __name__ == "__main__":
    main(sys.argv[1:])

"""Ours and tipg's rates, measured in turn so that both have the same machine."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

from http_load.crowded_map import PROPERTIES, TILE_PROPERTIES, boxes, crowded_cluster, tiles
from http_load.generator import Load, loaded
from http_load.peer import served_tipg
from map_http.served import served_map

ROUNDS, SECONDS = 3, 4
WARM_UP_S = 2
ITEMS, LAYER = "/collections/{}/items?limit=100&bbox=", "public.landmarks"
ZOOM = 16  # tiles of about 260 landmarks
SMALL_CACHE_MIB, LARGE_CACHE_MIB = 1, 64


@dataclass(slots=True)
class Beside:
    """Loads of one kind, ours and tipg's."""

    ours: list[Load] = field(default_factory=list)
    theirs: list[Load] = field(default_factory=list)

    @property
    def ratio(self) -> float:
        """Our median rate over theirs."""
        return self.rate_hz / median(one.rate_hz for one in self.theirs)

    @property
    def rate_hz(self) -> float:
        """Our median rate."""
        return median(one.rate_hz for one in self.ours)

    @property
    def p99_ms(self) -> float:
        """Our median slowest hundredth."""
        return median(one.p99_ms for one in self.ours)


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """Pages of features, tiles never asked for before, and tiles asked for again."""

    items: Beside
    cold: Beside
    warm: Beside


def compared(folder: Path) -> Compared:
    """Each server is one process with the defaults of its settings, but what bounds how often one may ask."""
    folder.mkdir(parents=True, exist_ok=True)
    queries = boxes(5000)
    places = tiles(ZOOM)
    with crowded_cluster() as (cluster, database), served_tipg(cluster, database, folder) as tipg:
        lines = f'url = "{cluster.url(database)}"\npassword_file = "{cluster.password_file}"'
        their_items = [f"{ITEMS.format(LAYER)}{box}&properties={PROPERTIES}" for box in queries]
        their_tiles = [
            f"/collections/{LAYER}/tiles/WebMercatorQuad/{place}?properties={TILE_PROPERTIES}" for place in places
        ]
        our_tiles = [f"/tiles/landmarks/{place}" for place in places]

        def of(ours: list[str], theirs: list[str], *, cache_mib: int, warm_up: Callable[[str], object]) -> Beside:
            web = f"rate_hz = 1e6\nburst = 1000000\ntile_cache_mib = {cache_mib}"
            found = Beside()
            with served_map(folder, database=lines, web=web) as served:
                warm_up(served.url)
                for _ in range(ROUNDS):
                    found.ours.append(loaded(served.url, ours, folder, seconds=SECONDS))
                    found.theirs.append(loaded(tipg, theirs, folder, seconds=SECONDS))
            return found

        def briefly(url: str) -> None:
            loaded(url, our_items[:100], folder, seconds=WARM_UP_S)

        our_items = [f"{ITEMS.format('landmarks')}{box}" for box in queries]
        loaded(tipg, their_items[:100], folder, seconds=WARM_UP_S)
        return Compared(
            items=of(our_items, their_items, cache_mib=LARGE_CACHE_MIB, warm_up=briefly),
            cold=of(our_tiles, their_tiles, cache_mib=SMALL_CACHE_MIB, warm_up=briefly),
            warm=of(
                our_tiles,
                their_tiles,
                cache_mib=LARGE_CACHE_MIB,
                warm_up=lambda url: loaded(url, our_tiles, folder, seconds=2 * WARM_UP_S),
            ),
        )

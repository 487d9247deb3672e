"""The landmarks of one map version in memory, found by place and condition, each as the bytes it is answered with."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.projection import geodesic_distances_m
from trigpoint.landmarks.messages import entry_of, landmark_bytes
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.queries import DegreeBox, Disc, LandmarkQuery, Nearest, area_box
from trigpoint.landmarks.selection import WIDENING_M

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Place = tuple[float, float]  # latitude and longitude in degrees

CELL_DEG = 1.0 / 1024.0  # of the grid: some 100 m
CELLS_MOST = 4096  # looked up one by one; a wider area is looked for among all
FIRST_ROOM = 1024

NOTHING: Mapping[int, Place] = MappingProxyType({})

LAT, LON, SIGMA = range(3)
FIRST_SEEN, LAST_SEEN, KIND = range(3)


@dataclass(frozen=True, slots=True)
class FoundSlots:
    """Where the landmarks of an answer are held, in its order, how far each is in m (none where nobody asked),
    and whether more would follow."""

    slots: list[int]
    distances_m: Sequence[float]
    more: bool


class MemoryIndex:
    """Landmarks by id in slots; the grid's cells say which slots lie in them. Not for several threads at once."""

    def __init__(self) -> None:
        self._numbers: Floats = np.zeros((FIRST_ROOM, 3))  # lat and lon in degrees, sigma in m
        self._wholes: Ints = np.zeros((FIRST_ROOM, 3), dtype=np.int64)  # first and last seen in ns, kind
        self._held: Bools = np.zeros(FIRST_ROOM, dtype=np.bool_)
        self._places: list[Place] = []  # lat and lon again: one by one these are read faster
        self._names: list[str] = []
        self._vehicles: list[tuple[str, ...]] = []
        self._bytes: list[bytes] = []
        self._entries: list[bytes] = []
        self._kinds: dict[str, int] = {}
        self._slots: dict[str, int] = {}
        self._free: list[int] = []
        self._cells: dict[tuple[int, int], dict[int, Place]] = {}

    def __len__(self) -> int:
        return len(self._slots)

    def name(self, slot: int) -> str:
        """The id of a landmark."""
        return self._names[slot]

    def entries(self, slots: Sequence[int]) -> list[bytes]:
        """Landmarks as they stand in an answer."""
        entries = self._entries
        return [entries[slot] for slot in slots]

    def landmarks(self, slots: Sequence[int]) -> list[bytes]:
        """Landmarks as the bytes of their messages."""
        return [self._bytes[slot] for slot in slots]

    def places_deg(self, slots: Sequence[int]) -> tuple[Floats, Floats]:
        """Latitudes and longitudes (n,)."""
        return self._numbers[slots, LAT], self._numbers[slots, LON]

    def change(self, changed: Iterable[Landmark], removed: Iterable[str]) -> None:
        """Landmarks put in, in the place of those of their ids, and others taken out."""
        for name in removed:
            self._take_out(name)
        for landmark in changed:
            self._take_out(landmark.landmark)
            self._put_in(landmark)

    def _take_out(self, name: str) -> None:
        slot = self._slots.pop(name, None)
        if slot is None:
            return
        cell = _cell(*self._places[slot])
        del self._cells[cell][slot]
        if not self._cells[cell]:
            del self._cells[cell]
        self._held[slot] = False
        self._free.append(slot)

    def _put_in(self, landmark: Landmark) -> None:
        slot = self._free.pop() if self._free else self._new_slot()
        kind = self._kinds.setdefault(landmark.kind, len(self._kinds))
        self._places[slot] = (landmark.lat_deg, landmark.lon_deg)
        self._numbers[slot] = (landmark.lat_deg, landmark.lon_deg, landmark.sigma_major_m)
        self._wholes[slot] = (landmark.first_seen_ns, landmark.last_seen_ns, kind)
        self._held[slot] = True
        self._names[slot], self._vehicles[slot] = landmark.landmark, landmark.vehicles
        self._bytes[slot] = landmark_bytes(landmark)
        self._entries[slot] = entry_of(self._bytes[slot])
        self._slots[landmark.landmark] = slot
        self._cells.setdefault(_cell(*self._places[slot]), {})[slot] = self._places[slot]

    def _new_slot(self) -> int:
        slot = len(self._names)
        if slot == len(self._held):
            self._numbers = np.concatenate([self._numbers, np.zeros_like(self._numbers)])
            self._wholes = np.concatenate([self._wholes, np.zeros_like(self._wholes)])
            self._held = np.concatenate([self._held, np.zeros_like(self._held)])
        self._names.append("")
        self._places.append((0.0, 0.0))
        self._vehicles.append(())
        self._bytes.append(b"")
        self._entries.append(b"")
        return slot

    def found(self, query: LandmarkQuery, *, limit: int | None = None) -> FoundSlots:
        """The landmarks that meet a query, whatever version it names, as a store would answer it; `limit` in the place
        of the query's, if that has none."""
        if not query.by_distance:
            return self._by_id(query, query.limit or limit)
        if query.nearest is not None:
            ranked = self._nearest(query, query.nearest)
        elif query.near is not None:
            ranked = self._within(query, query.near, query.near.radius_m)
        if query.after is not None:
            mark = (query.after.distance_m or 0.0, query.after.landmark)
            ranked = [one for one in ranked if one[:2] > mark]
        kept = ranked[: query.limit or limit]
        return FoundSlots([one[2] for one in kept], [one[0] for one in kept], len(kept) < len(ranked))

    def _by_id(self, query: LandmarkQuery, limit: int | None) -> FoundSlots:
        names, slots = self._names, self._meeting(query)
        if query.after is not None:
            mark = query.after.landmark
            slots = [slot for slot in slots if names[slot] > mark]
        slots.sort(key=names.__getitem__)
        kept = slots[:limit]
        return FoundSlots(kept, (), len(kept) < len(slots))

    def _within(self, query: LandmarkQuery, around: Disc, radius_m: float) -> list[tuple[float, str, int]]:
        """What meets the conditions within a radius, in order of distance."""
        slots = self._meeting(query)
        lat_deg, lon_deg = self._numbers[slots, LAT], self._numbers[slots, LON]
        distance_m = geodesic_distances_m(around.lat_deg, around.lon_deg, lat_deg=lat_deg, lon_deg=lon_deg)
        pairs = zip(distance_m.tolist(), slots, strict=True)
        return sorted((far_m, self._names[slot], slot) for far_m, slot in pairs if far_m <= radius_m)

    def _nearest(self, query: LandmarkQuery, place: Nearest) -> list[tuple[float, str, int]]:
        anywhere = replace(query, nearest=None)
        for radius_m in WIDENING_M:
            around = Disc(lat_deg=place.lat_deg, lon_deg=place.lon_deg, radius_m=radius_m)
            found = self._within(replace(anywhere, near=around), around, radius_m)
            if len(found) >= place.count:
                return found[: place.count]
        return self._within(anywhere, around, math.inf)[: place.count]

    def _meeting(self, query: LandmarkQuery) -> list[int]:
        """The slots that meet every condition but distance, in no order."""
        slots = self._in_area(query)
        if query.kinds or query.max_sigma_m is not None or query.seen is not None:
            among = np.array(slots, dtype=np.int64)
            slots = among[self._conditions(query, among)].tolist()
        if query.vehicle is None:
            return slots
        return [slot for slot in slots if query.vehicle in self._vehicles[slot]]

    def _conditions(self, query: LandmarkQuery, slots: Ints) -> Bools:
        numbers, wholes = self._numbers[slots], self._wholes[slots]
        meets = np.ones(len(slots), dtype=np.bool_)
        if query.max_sigma_m is not None:
            meets &= numbers[:, SIGMA] <= query.max_sigma_m
        if query.seen is not None:
            meets &= (wholes[:, FIRST_SEEN] <= query.seen.last_ns) & (wholes[:, LAST_SEEN] >= query.seen.first_ns)
        if query.kinds:
            meets &= np.isin(wholes[:, KIND], [self._kinds.get(kind, -1) for kind in query.kinds])
        return meets

    def _in_area(self, query: LandmarkQuery) -> list[int]:
        """The slots inside a query's box; of a disc, those of the cells around it."""
        box, cells = query.bbox, self._cells_around(area_box(query))
        if cells is None:
            every = np.flatnonzero(self._held)
            wide: list[int] = (every if box is None else every[_inside(self._numbers[every], box)]).tolist()
            return wide
        if box is None:
            return list(chain.from_iterable(cells))
        west, south, east, north = box.lon_min_deg, box.lat_min_deg, box.lon_max_deg, box.lat_max_deg
        return [
            slot
            for cell in cells
            for slot, (lat_deg, lon_deg) in cell.items()
            if south <= lat_deg <= north and west <= lon_deg <= east
        ]

    def _cells_around(self, box: DegreeBox | None) -> list[Mapping[int, Place]] | None:
        """The slots of each cell a box meets; None for more cells than are looked up one by one."""
        if box is None:
            return None
        low, high = _cell(box.lat_min_deg, box.lon_min_deg), _cell(box.lat_max_deg, box.lon_max_deg)
        if (high[0] - low[0] + 1) * (high[1] - low[1] + 1) > CELLS_MOST:
            return None
        rows, columns = range(low[0], high[0] + 1), range(low[1], high[1] + 1)
        return [self._cells.get((row, column), NOTHING) for row in rows for column in columns]


def _cell(lat_deg: float, lon_deg: float) -> tuple[int, int]:
    return math.floor(lat_deg / CELL_DEG), math.floor(lon_deg / CELL_DEG)


def _inside(numbers: Floats, box: DegreeBox) -> Bools:
    lat_deg, lon_deg = numbers[:, LAT], numbers[:, LON]
    inside = (lat_deg >= box.lat_min_deg) & (lat_deg <= box.lat_max_deg)
    inside &= (lon_deg >= box.lon_min_deg) & (lon_deg <= box.lon_max_deg)
    return np.asarray(inside)

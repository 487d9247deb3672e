"""What was observed when, read from the log: the sweeps of every drive, and its path in the newest map version."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.mapped import MapSolved, TrajectorySolved
from trigpoint.events.observed import LandmarksDetected
from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.projection import MapFrame, wgs84_from_map_points
from trigpoint.geodesy.web_tiles import WebTile, tile_at
from trigpoint.landmarks.asked import AnsweredMap, CoverageAnswer, CoverageQuestion, CoveredTile
from trigpoint.logs.following import StreamFollower
from trigpoint.logs.ports import EventLog, LoggedEvent
from trigpoint.logs.readings import logged_frame
from trigpoint_landmarks.core.coverage import (
    COLUMN,
    COVERAGE_ZOOM,
    FIRST,
    LAST,
    ROW,
    SweepPlaces,
    passes_over_tiles,
    places_on_path,
)

Ints = NDArray[np.int64]
Drive = tuple[str, str]  # vehicle and boot

BATCH_EVENTS = 20_000
MAP_STREAM = STREAM_PATTERNS[MapSolved]
VEHICLE_STREAM = STREAM_PATTERNS[LandmarksDetected].format(vehicle="")


@dataclass(slots=True)
class _Sweeps:
    """A drive's sweeps so far."""

    stamps_ns: list[int] = field(default_factory=list)
    range_m: float = 0.0


class ObservedTiles:
    """Follows the log; passes over tiles are worked out when they are asked for, and kept. Not for several threads."""

    def __init__(self, log: EventLog, *, tiles_most: int) -> None:
        self._log, self._tiles_most = log, tiles_most
        self._sweeping = StreamFollower(log, lambda name: name.startswith(VEHICLE_STREAM), kinds=(LandmarksDetected,))
        self._solving = StreamFollower(log, (MAP_STREAM,), kinds=(MapSolved, TrajectorySolved))
        self._sweeps: dict[Drive, _Sweeps] = {}
        self._pending: list[TrajectorySolved] = []
        self._paths: dict[Drive, TrajectorySolved] = {}
        self._passes: dict[Drive, tuple[tuple[int, int], Ints]] = {}
        self._map = AnsweredMap()

    def answer(self, question: CoverageQuestion) -> CoverageAnswer:
        """The passes over the tiles asked for, of all drives of the newest version in the log.

        Raises InputError for more tiles than are answered at once, LogDamaged where the log is.
        """
        self._follow()
        tiles: list[CoveredTile] = []
        for vehicle, boot_id in sorted(self._paths):
            if question.vehicle in (None, vehicle):
                rows = _asked(self._passes_of((vehicle, boot_id)), question)
                self._require_few(len(tiles) + len(rows))
                tiles += [
                    CoveredTile(
                        tile=WebTile(COVERAGE_ZOOM, column, row),
                        vehicle=vehicle,
                        first_ns=first_ns,
                        last_ns=last_ns,
                        sweep_count=sweep_count,
                    )
                    for column, row, first_ns, last_ns, sweep_count in rows.tolist()
                ]
        return CoverageAnswer(map=self._map, tiles=tuple(tiles))

    def _require_few(self, count: int) -> None:
        if count > self._tiles_most:
            raise InputError(f"{count} passes over tiles or more, at most {self._tiles_most} are answered at once")

    def _follow(self) -> None:
        while rows := self._sweeping.take(BATCH_EVENTS):
            for row in rows:
                self._take_sweep(row)
        while rows := self._solving.take(BATCH_EVENTS):
            for row in rows:
                self._take_solved(row)

    def _take_sweep(self, row: LoggedEvent) -> None:
        envelope = row.envelope
        if isinstance(envelope.event, LandmarksDetected):
            identity = envelope.identity
            sweeps = self._sweeps.setdefault((identity.source, identity.boot_id), _Sweeps())
            sweeps.stamps_ns.append(envelope.stamp_ns)
            ranges_m = (detection.range_m for detection in envelope.event.detections)
            sweeps.range_m = max(sweeps.range_m, max(ranges_m, default=0.0))

    def _take_solved(self, row: LoggedEvent) -> None:
        event = row.envelope.event
        if isinstance(event, TrajectorySolved):
            self._pending.append(event)
        elif isinstance(event, MapSolved):
            own = {(one.vehicle, one.boot_id): one for one in self._pending if one.map_version == event.map_version}
            self._paths = own if event.base_version == 0 else self._paths | own
            self._pending.clear()
            frame = self._frame()
            self._map = AnsweredMap(
                map_version=event.map_version,
                solved_ns=row.envelope.stamp_ns,
                crs=frame.crs,
                origin_easting_m=frame.origin_easting_m,
                origin_northing_m=frame.origin_northing_m,
            )

    def _frame(self) -> MapFrame:
        return logged_frame(self._log)

    def _passes_of(self, drive: Drive) -> Ints:
        """A drive's passes, worked out anew where its path or its sweeps are others than the last time."""
        path, sweeps = self._paths[drive], self._sweeps.get(drive, _Sweeps())
        state = (path.map_version, len(sweeps.stamps_ns))
        known = self._passes.get(drive)
        if known is None or known[0] != state:
            known = self._passes[drive] = (state, self._worked_out(path, sweeps))
        return known[1]

    def _worked_out(self, path: TrajectorySolved, sweeps: _Sweeps) -> Ints:
        if not len(path.stamp_ns) or not sweeps.stamps_ns:
            return np.empty((0, 5), dtype=np.int64)
        sweep_ns = np.array(sweeps.stamps_ns, dtype=np.int64)
        poses_m = np.asarray(path.pose, dtype=np.float64).reshape(-1, 3)[:, :2]
        stamp_ns, point_m = places_on_path(np.asarray(path.stamp_ns, dtype=np.int64), poses_m, sweep_ns)
        lat_deg, lon_deg = wgs84_from_map_points(point_m, self._frame())
        places = SweepPlaces(stamp_ns=stamp_ns, lat_deg=lat_deg, lon_deg=lon_deg, range_m=sweeps.range_m)
        return passes_over_tiles(places)


def _asked(passes: Ints, question: CoverageQuestion) -> Ints:
    """The passes over tiles that meet the box, and in the span."""
    wanted = np.ones(len(passes), dtype=np.bool_)
    if question.bbox is not None:
        north_west = tile_at(Wgs84Position(question.bbox.lat_max_deg, question.bbox.lon_min_deg), COVERAGE_ZOOM)
        south_east = tile_at(Wgs84Position(question.bbox.lat_min_deg, question.bbox.lon_max_deg), COVERAGE_ZOOM)
        wanted &= (passes[:, COLUMN] >= north_west.column) & (passes[:, COLUMN] <= south_east.column)
        wanted &= (passes[:, ROW] >= north_west.row) & (passes[:, ROW] <= south_east.row)
    if question.seen is not None:
        wanted &= (passes[:, FIRST] <= question.seen.last_ns) & (passes[:, LAST] >= question.seen.first_ns)
    return passes[wanted]

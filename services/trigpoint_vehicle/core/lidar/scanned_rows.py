"""A drive's rows with the sweeps of its lidar among them, each cast only when it is asked for."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import overload

import numpy as np

from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import Observed
from trigpoint.events.scanned import PointsScanned
from trigpoint_vehicle.core.lidar.scans import SWEEPS_AT_ONCE, DriveScans

Row = Envelope[Observed]
Casting = Callable[[Callable[[int], list[PointsScanned]], Iterable[int]], Iterable[list[PointsScanned]]]


class ScannedRows(Sequence[Row]):
    """All events of a drive in order of stamp, numbered from 0 in a boot of their own.

    `casting` is what applies the casting of a few sweeps to the numbers of their first, as `map` does: in order.
    """

    def __init__(self, others: Sequence[Row], scans: DriveScans, *, boot_id: str, casting: Casting = map) -> None:
        self._others, self._scans, self._boot_id, self._casting = others, scans, boot_id, casting
        stamps = np.concatenate([np.array([row.stamp_ns for row in others], dtype=np.int64), scans.stamp_ns()])
        self._order = np.argsort(stamps, kind="stable")
        self._stamp_ns = stamps[self._order]

    def __len__(self) -> int:
        return len(self._order)

    @overload
    def __getitem__(self, number: int) -> Row: ...
    @overload
    def __getitem__(self, number: slice) -> Sequence[Row]: ...
    def __getitem__(self, number: int | slice) -> Row | Sequence[Row]:
        if isinstance(number, slice):
            return tuple(self[one] for one in range(*number.indices(len(self))))
        number = range(len(self))[number]
        sweep = int(self._order[number]) - len(self._others)
        event = self._others[sweep].event if sweep < 0 else self._scans.events(sweep, sweep + 1)[0]
        return self._row(number, event)

    def __iter__(self) -> Iterator[Row]:
        groups = self._casting(self._cast, range(0, len(self._scans), SWEEPS_AT_ONCE))
        sweeps = (sweep for group in groups for sweep in group)
        for number, index in enumerate(self._order.tolist()):
            among = index < len(self._others)
            yield self._row(number, self._others[index].event if among else next(sweeps))

    def _cast(self, first: int) -> list[PointsScanned]:
        return self._scans.events(first, min(first + SWEEPS_AT_ONCE, len(self._scans)))

    def _row(self, number: int, event: Observed) -> Row:
        source = self._others[0].identity.source
        return Envelope(EventIdentity(source, self._boot_id, number), int(self._stamp_ns[number]), event)

"""Where drives were, from the fixes in their vehicles' streams."""

import logging
from collections.abc import Mapping
from typing import cast

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import LogDamaged
from trigpoint.events.drives import fix_series
from trigpoint.events.envelope import Envelope
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.observed import GnssFixReceived
from trigpoint.logs.ports import EventLog, LoggedBoot
from trigpoint_perception.core.closures.extents import Extent, cannot_meet, extent_of

STREAM_OF_VEHICLE = STREAM_PATTERNS[GnssFixReceived]

DriveName = tuple[str, str]
Ints = NDArray[np.int64]

logger = logging.getLogger(__name__)


class Whereabouts:
    """Which drives cannot have met, by the stamps (n,) of their sweeps; a drive's fixes are read when it is first asked
    about, and not kept."""

    def __init__(self, log: EventLog, stamp_ns: Mapping[DriveName, Ints]) -> None:
        self._log, self._stamp_ns = log, stamp_ns
        self._boots: dict[DriveName, LoggedBoot] = {}
        self._extents: dict[DriveName, Extent | None] = {}

    def apart(self, one: DriveName, other: DriveName) -> bool:
        """Whether two drives cannot have met; never said of one without a fix that can be read."""
        return cannot_meet(self._extent(one), self._extent(other))

    def _extent(self, name: DriveName) -> Extent | None:
        if name not in self._extents:
            try:
                self._extents[name] = extent_of(self._stamp_ns[name], fix_series(self._fixes(name)))
            except LogDamaged as error:
                logger.warning("fixes not read, the drive is compared with all: %s", error)
                self._extents[name] = None
        return self._extents[name]

    def _fixes(self, name: DriveName) -> list[Envelope[GnssFixReceived]]:
        vehicle, boot_id = name
        stream = STREAM_OF_VEHICLE.format(vehicle=vehicle)
        if name not in self._boots:
            self._boots |= {(boot.source, boot.boot_id): boot for boot in self._log.boots(stream)}
        boot = self._boots.get(name)
        if boot is None:
            return []
        read = self._log.read(stream, from_ns=boot.start_ns, until_ns=boot.end_ns + 1, kinds=(GnssFixReceived,))
        rows = (cast(Envelope[GnssFixReceived], row.envelope) for row in read)
        return [row for row in rows if (row.identity.source, row.identity.boot_id) == name]

"""A manifest and the texts it speaks of, read part by part."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint_vehicle.core.manifest_quantities import Quantity
from trigpoint_vehicle.core.source_frames import SourceFrame, wgs84_from_source
from trigpoint_vehicle.core.source_times import UNIT_NS, leap_correction_ns, unix_ns
from trigpoint_vehicle.core.table_manifest import Clock, FilePart, Manifest, PositionPart, TimeColumn, Vehicle
from trigpoint_vehicle.core.text_tables import SourceText, TextTable, text_table

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Reading:
    """A manifest beside the texts of its files: `text[i]` is that of `file[i]`."""

    manifest: Manifest
    file: tuple[str, ...]
    text: tuple[SourceText, ...]

    def source(self, part: FilePart, vehicle: Vehicle | None = None) -> SourceText:
        """The text a part reads."""
        return self.text[self.file.index(part.file or (vehicle.file if vehicle else ""))]

    def table(self, part: FilePart, vehicle: Vehicle | None = None) -> TextTable:
        """The table a part reads. Raises InputError."""
        source = self.source(part, vehicle)
        return text_table(source, columns=part.columns, delimiter=part.delimiter, comment=part.comment)

    def clock(self, vehicle: Vehicle) -> Clock:
        """The clock of a vehicle's times."""
        return vehicle.clock or self.manifest.clock

    def frame(self, part: PositionPart) -> SourceFrame:
        """The frame of a part's positions. Raises FrameRefused."""
        return (part.frame or self.manifest.frame).source_frame()


def stamps_ns(table: TextTable, time: TimeColumn, clock: Clock) -> Ints:
    """Stamps (n,) of a table's rows. Raises InputError naming the cell."""
    epoch_ns = unix_ns(clock.second_zero()) + round(time.offset_s * UNIT_NS["s"])
    stamps = table.stamps_ns(time.column, unit_ns=UNIT_NS[time.unit], epoch_ns=epoch_ns)
    if clock.scale == "utc" or len(stamps) == 0:
        return stamps
    # a drive is short: the leap seconds of its first instant serve for all of it
    return stamps + leap_correction_ns(int(stamps.min()), clock.scale)


def numbers(quantity: Quantity | None, table: TextTable) -> Floats:
    """A quantity (n,) in metres, radians and seconds; NaN for one that is not given. Raises InputError."""
    return np.full(len(table.line_number), np.nan) if quantity is None else quantity.of(table)


def coordinates(part: PositionPart, table: TextTable, frame: SourceFrame) -> tuple[Floats, Floats]:
    """Source coordinates (n,), x or longitude first. Raises InputError if they are not what the frame is made of."""
    given_in_degrees = part.lat is not None
    if given_in_degrees != frame.in_degrees:
        wanted = "lat and lon" if frame.in_degrees else "east and north"
        raise InputError(f"{table.source}: its frame {frame.crs!r} needs {wanted}")
    x, y = (part.lon, part.lat) if given_in_degrees else (part.east, part.north)
    return numbers(x, table), numbers(y, table)


def positions(part: PositionPart, table: TextTable, frame: SourceFrame) -> tuple[Floats, Floats]:
    """Latitudes and longitudes (n,) in degrees, NaN where a row has none. Raises InputError, FrameRefused."""
    return wgs84_from_source(*coordinates(part, table, frame), frame)

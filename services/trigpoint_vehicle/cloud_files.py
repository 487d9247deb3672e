"""Files with the points of one scan each: PCD, KITTI's .bin, LAS and LAZ; the only home of the library for these."""

import csv
import io
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import laspy
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from trigpoint.errors import EventRejected, InputError
from trigpoint.events.envelope import Envelope
from trigpoint.events.observed import Observed
from trigpoint.events.packed_points import PackedPoints, unpacked_points
from trigpoint.events.scanned import PointsScanned
from trigpoint_vehicle.cloud_conversion import POINTS_LIMIT, LeftAside, writable
from trigpoint_vehicle.core.kitti import bin_points
from trigpoint_vehicle.core.mountings import Mounting
from trigpoint_vehicle.core.pcd import pcd_points
from trigpoint_vehicle.core.recording import Recording, Timed, rows_with
from trigpoint_vehicle.core.returns import returned_points
from trigpoint_vehicle.core.scan_rows import LISTED_COLUMNS, ScanRow, ScanSource
from trigpoint_vehicle.core.text_tables import SourceText

NS_PER_S = 1_000_000_000
GPS_TIME = "gps_time"

Floats = NDArray[np.float64]


def listed_files(folder: Path, pattern: str) -> SourceText:
    """A table of the files of a pattern: their path from the folder, and their name without suffix.

    Raises InputError where there is none.
    """
    try:
        paths = sorted(path.relative_to(folder).as_posix() for path in folder.glob(pattern))
    except (ValueError, NotImplementedError, OSError) as error:  # empty, absolute, or a folder that cannot be read
        raise InputError(f"{folder}: {pattern!r} is no pattern of files in it: {error}") from error
    if not paths:
        raise InputError(f"{folder}: no file {pattern}")
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(LISTED_COLUMNS)
    rows.writerows((path, Path(path).stem) for path in paths)
    return SourceText(str(folder / pattern), text.getvalue())


@dataclass(frozen=True, slots=True)
class VehicleScans:
    """The scans of each vehicle, by its name, their files from `folder` on, and what of them was left aside."""

    folder: Path = Path()
    by_vehicle: Mapping[str, Sequence[ScanSource]] = field(default_factory=dict)
    left_aside: LeftAside = field(default_factory=LeftAside)

    def rows_of(self, recording: Recording) -> Iterable[Envelope[Observed]]:
        """The recording's rows with its scans among them, each file read when its turn comes."""
        own = self.by_vehicle.get(recording.vehicle, ())
        return rows_with(recording, [self._scanned(one) for one in own]) if own else recording.rows

    def _scanned(self, source: ScanSource) -> Iterator[Timed]:
        return writable(scanned(self.folder, source, self.left_aside), self.left_aside)


def scanned(folder: Path, source: ScanSource, aside: LeftAside) -> Iterator[Timed]:
    """The sweeps of some files, in their order; one that cannot be read is counted and left aside."""
    for row in tqdm(source.rows, desc="reading scans", unit="scan", disable=None):
        try:
            yield row.stamp_ns, _sweep(folder / row.path, row, source)
        except EventRejected as error:
            aside.add(error.reason, f"{folder / row.path}: {error.detail}")
        except InputError as error:
            aside.add("unreadable scan", str(error))


def _sweep(path: Path, row: ScanRow, source: ScanSource) -> PointsScanned:
    mounting: Mounting = source.mounting
    points = _points(path, row, source)
    return PointsScanned(
        sensor=source.sensor,
        sensor_position_m=mounting.position_m,
        sensor_orientation=mounting.orientation,
        point_m=returned_points(points.point_m),
        intensity=points.intensity,
        offset_ns=points.offset_ns,
        ring=points.ring,
    )


def _points(path: Path, row: ScanRow, source: ScanSource) -> PackedPoints:
    suffix = path.suffix.lower()
    try:
        if suffix in (".las", ".laz"):
            return _las_points(path, source)
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    if suffix == ".pcd":
        packed = pcd_points(str(path), content)
        return unpacked_points(packed.fields, packed.data, stride=packed.stride, stamp_ns=row.stamp_ns)
    if suffix == ".bin":
        point_m, intensity = bin_points(str(path), content)
        return _columns(point_m, intensity, np.zeros(len(intensity)))
    raise InputError(f"{path}: {suffix or 'a name without suffix'} is none of .pcd, .bin, .las, .laz")


@dataclass(frozen=True, slots=True)
class _Las:
    """What of a LAS file is used: points (n, 3) in its own CRS, intensity (n,), and GPS time (n,) in s or None."""

    point: Floats
    intensity: NDArray[np.float32]
    time_s: Floats | None


def _las_points(path: Path, source: ScanSource) -> PackedPoints:
    las = _las(path)
    offset_s = np.zeros(len(las.point))
    if source.has_point_times:
        if las.time_s is None:
            raise InputError(f"{path}: its points have no {GPS_TIME}, and point_times asks for it")
        offset_s = las.time_s - las.time_s[:1]
    with np.errstate(over="ignore"):
        point_m = (las.point - np.array(source.origin_m)).astype(np.float32)
    return _columns(point_m, las.intensity, offset_s)


def _las(path: Path) -> _Las:
    try:
        with laspy.open(path) as file:
            if file.header.point_count > POINTS_LIMIT:
                raise InputError(f"{path}: {file.header.point_count} points, limit {POINTS_LIMIT}")
            if file.header.are_points_compressed:
                _require_chunks(path, file.header)
            read = file.read()
    except (laspy.errors.LaspyException, ValueError, RuntimeError, EOFError) as error:
        raise InputError(f"{path}: no LAS or LAZ file that can be read: {error}") from error
    has_time = GPS_TIME in read.point_format.dimension_names
    return _Las(
        point=np.column_stack((read.x, read.y, read.z)).astype(np.float64),
        intensity=np.asarray(read.intensity, dtype=np.float32),
        time_s=np.asarray(read.gps_time, dtype=np.float64) if has_time else None,
    )


def _require_chunks(path: Path, header: laspy.LasHeader) -> None:
    """Nothing, if a LAZ file's table of chunks has no more of them than points: the library makes room for what that
    says before it reads any (LASzip's format: the table's place, then its version and its length)."""
    with path.open("rb") as file:
        file.seek(header.offset_to_point_data)
        place = int.from_bytes(file.read(8), "little", signed=True)
        if place < 0:  # it was written to a stream, and the place stands at the file's end
            file.seek(-8, os.SEEK_END)
            place = int.from_bytes(file.read(8), "little", signed=True)
        file.seek(place)
        head = file.read(8)
    count = int.from_bytes(head[4:], "little")
    if len(head) < 8 or count > max(header.point_count, 1):
        raise InputError(f"{path}: a table of {count} chunks for {header.point_count} points")


def _columns(point_m: NDArray[np.float32], intensity: NDArray[np.float32], offset_s: Floats) -> PackedPoints:
    offset_ns = np.rint(offset_s * NS_PER_S)
    limit_ns = float(np.iinfo(np.int32).max)
    if (np.abs(offset_ns) > limit_ns).any():
        farthest_s = float(np.abs(offset_s).max())
        raise InputError(f"a point {farthest_s:.6g} s after the first of its scan, limit {limit_ns / NS_PER_S:.3f} s")
    return PackedPoints(
        point_m=point_m,
        intensity=intensity,
        offset_ns=offset_ns.astype(np.int32),
        ring=np.zeros(len(intensity), dtype=np.uint16),
    )

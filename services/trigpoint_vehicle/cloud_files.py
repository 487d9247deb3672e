"""Files with the points of one scan each: PCD, KITTI's .bin, LAS and LAZ."""

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from trigpoint.errors import EventRejected, InputError
from trigpoint.events.envelope import Envelope
from trigpoint.events.observed import Observed
from trigpoint.events.packed_points import PackedPoints, unpacked_points
from trigpoint.events.scanned import PointsScanned
from trigpoint_vehicle.cloud_conversion import LeftAside, writable
from trigpoint_vehicle.core.kitti import bin_points
from trigpoint_vehicle.core.mountings import Mounting
from trigpoint_vehicle.core.pcd import pcd_points, pcd_viewpoint
from trigpoint_vehicle.core.recording import Recording, Timed, rows_with
from trigpoint_vehicle.core.returns import returned_points
from trigpoint_vehicle.core.scan_rows import LISTED_COLUMNS, ScanRow, ScanSource
from trigpoint_vehicle.core.text_tables import SourceText
from trigpoint_vehicle.las_files import GPS_TIME
from trigpoint_vehicle.las_reader import LasReader

NS_PER_S = 1_000_000_000

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
    with LasReader() as las:
        for row in tqdm(source.rows, desc="reading scans", unit="scan", disable=None):
            path = folder / row.path
            try:
                points = _points(path, row, source, las)
                yield row.stamp_ns, _sweep(points, _mounting(path, source), source)
            except EventRejected as error:
                aside.add(error.reason, f"{path}: {error.detail}")
            except InputError as error:
                aside.add("unreadable scan", str(error))


def _mounting(path: Path, source: ScanSource) -> Mounting:
    """As the manifest says, else the file."""
    return source.mounting or pcd_viewpoint(str(path), _content(path))


def _sweep(points: PackedPoints, mounting: Mounting, source: ScanSource) -> PointsScanned:
    return PointsScanned(
        sensor=source.sensor,
        sensor_position_m=mounting.position_m,
        sensor_orientation=mounting.orientation,
        point_m=returned_points(points.point_m),
        intensity=points.intensity,
        offset_ns=points.offset_ns,
        ring=points.ring,
    )


def _points(path: Path, row: ScanRow, source: ScanSource, las: LasReader) -> PackedPoints:
    suffix = path.suffix.lower()
    if suffix in (".las", ".laz"):
        return _las_points(path, source, las)
    if suffix == ".pcd":
        packed = pcd_points(str(path), _content(path))
        return unpacked_points(packed.fields, packed.data, stride=packed.stride, stamp_ns=row.stamp_ns)
    if suffix == ".bin":
        point_m, intensity = bin_points(str(path), _content(path))
        return _columns(point_m, intensity, np.zeros(len(intensity)))
    raise InputError(f"{path}: {suffix or 'a name without suffix'} is none of .pcd, .bin, .las, .laz")


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error}") from error


def _las_points(path: Path, source: ScanSource, reader: LasReader) -> PackedPoints:
    las = reader.points(path)
    offset_s = np.zeros(len(las.point))
    if source.has_point_times:
        if las.time_s is None:
            raise InputError(f"{path}: its points have no {GPS_TIME}, and point_times asks for it")
        offset_s = las.time_s - las.time_s[:1]
    with np.errstate(over="ignore"):
        point_m = (las.point - np.array(source.origin_m)).astype(np.float32)
    return _columns(point_m, las.intensity, offset_s)


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

"""The files of a KITTI raw drive: as they are published, or with all OXTS rows in one file and scans as npz."""

import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from trigpoint.errors import InputError
from trigpoint_vehicle.cloud_conversion import CloudDrive, LeftAside
from trigpoint_vehicle.core.kitti import (
    DESCRIBED,
    bin_points,
    even_stamps_ns,
    kitti_sweep,
    lidar_mounting,
    oxts_events,
    oxts_rows,
    turn_ns,
    written_stamps_ns,
)
from trigpoint_vehicle.core.mountings import Mounting
from trigpoint_vehicle.core.recording import Timed, boot_id_of
from trigpoint_vehicle.core.text_tables import SourceText
from trigpoint_vehicle.source_files import read_source

STEP_5MM = np.float32(0.005)
NPZ_COLUMNS = ("xyz_5mm", "intensity")
CALIBRATIONS = ("calib_imu_to_velo.txt", "../calib_imu_to_velo.txt", "oxts/tracking_calib.txt")

Points = tuple[NDArray[np.float32], NDArray[np.float32]]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Layout:
    """Where things are: the scans with their numbers, the OXTS rows, and the stamps of both (n,), -1 for none."""

    scans: dict[int, Path]
    oxts: SourceText
    scan_stamps_ns: NDArray[np.int64]
    oxts_stamps_ns: NDArray[np.int64]


def kitti_drive(source: Path) -> CloudDrive:
    """The drive in a folder, its scans still to be read. Raises InputError for a folder that is no such drive."""
    layout = _published(source) if (source / "velodyne_points").is_dir() else _collected(source)
    if not layout.scans:
        raise InputError(f"{source}: no scan in it, neither velodyne_points/data/*.bin nor scan_*.npz")
    mounting = lidar_mounting(_calibration(source))
    rows = oxts_rows(layout.oxts)
    if len(rows) != len(layout.oxts_stamps_ns):
        raise InputError(f"{layout.oxts.name}: {len(rows)} rows and {len(layout.oxts_stamps_ns)} stamps of them")
    told = layout.oxts_stamps_ns >= 0
    events = sorted(oxts_events(rows[told], layout.oxts_stamps_ns[told]), key=lambda timed: timed[0])
    names = "".join(f"{number} {path.name} {path.stat().st_size}\n" for number, path in layout.scans.items())
    aside = LeftAside()
    return CloudDrive(
        described=DESCRIBED,
        boot_id=boot_id_of(layout.oxts.text.encode(), names.encode()),
        streams=(events, _sweeps(layout, mounting, aside)),
        left_aside=aside,
    )


def _published(source: Path) -> _Layout:
    scans = {int(path.stem): path for path in sorted(source.glob("velodyne_points/data/*.bin")) if path.stem.isdigit()}
    rows = sorted((source / "oxts/data").glob("*.txt"))
    oxts = SourceText(str(source / "oxts/data"), "".join(read_source(path.parent, path.name).text for path in rows))
    return _Layout(
        scans=scans,
        oxts=oxts,
        scan_stamps_ns=written_stamps_ns(read_source(source, "velodyne_points/timestamps.txt")),
        oxts_stamps_ns=written_stamps_ns(read_source(source, "oxts/timestamps.txt")),
    )


def _collected(source: Path) -> _Layout:
    oxts = read_source(source, "oxts/oxts.txt")
    stamps_ns = even_stamps_ns(oxts_rows(oxts))
    named = ((path.stem.removeprefix("scan_"), path) for path in sorted(source.glob("scan_*.npz")))
    scans = {int(number): path for number, path in named if number.isdigit()}
    return _Layout(scans=scans, oxts=oxts, scan_stamps_ns=stamps_ns, oxts_stamps_ns=stamps_ns)


def _calibration(source: Path) -> SourceText:
    for name in CALIBRATIONS:
        if (source / name).is_file():
            return read_source(source, name)
    raise InputError(f"{source}: no calibration of the lidar, none of {', '.join(CALIBRATIONS)}")


def _sweeps(layout: _Layout, mounting: Mounting, aside: LeftAside) -> Iterator[Timed]:
    stamps_ns = layout.scan_stamps_ns
    turn = turn_ns(stamps_ns)
    for number, path in tqdm(layout.scans.items(), desc="reading scans", unit="scan", disable=None):
        if number >= len(stamps_ns) or stamps_ns[number] < 0:
            aside.add("scan without a stamp", f"{path}: scan {number}, stamps of {len(stamps_ns)} scans are there")
            continue
        try:
            point_m, intensity = _points(path)
        except InputError as error:
            aside.add("unreadable scan", str(error))
            continue
        yield int(stamps_ns[number]), kitti_sweep(point_m, intensity, mounting, turn_ns=turn)


def _points(path: Path) -> Points:
    try:
        return bin_points(str(path), path.read_bytes()) if path.suffix == ".bin" else _npz_points(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error}") from error


def _npz_points(path: Path) -> Points:
    try:
        with np.load(path) as arrays:
            steps, intensity = (arrays[name] for name in NPZ_COLUMNS)
    except (KeyError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: no arrays {' and '.join(NPZ_COLUMNS)}: {error}") from error
    if steps.shape != (len(intensity), 3):
        raise InputError(f"{path}: xyz_5mm of shape {steps.shape} and {len(intensity)} intensities")
    return steps.astype(np.float32) * STEP_5MM, intensity.astype(np.float32)

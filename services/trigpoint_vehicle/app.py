"""Reads recorded data or simulates a campus, and writes vehicles' logs with truth and anchors beside them."""

import logging
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

from tqdm import tqdm

from trigpoint.errors import InputError
from trigpoint.events.scanned import PointsScanned
from trigpoint.events.truth import truth_lines
from trigpoint.events.truth_objects import object_lines
from trigpoint.logs.vehicle_log import write_vehicle_log
from trigpoint_vehicle.aerial_files import PictureFolder, write_pictures
from trigpoint_vehicle.cloud_conversion import LeftAside, WrittenClouds, write_cloud_drive
from trigpoint_vehicle.cloud_files import VehicleScans, listed_files
from trigpoint_vehicle.core.aerial import aerial_pictures
from trigpoint_vehicle.core.anchors_geojson import anchors_geojson
from trigpoint_vehicle.core.campus import Campus, conversion_of, simulate_campus
from trigpoint_vehicle.core.lidar.scanned_campus import conversion_with_points, scanned_campus
from trigpoint_vehicle.core.lidar.scanned_rows import Casting
from trigpoint_vehicle.core.mrclam import BARCODES, LANDMARKS, RobotSources, mrclam, robot_files, robot_numbers
from trigpoint_vehicle.core.recording import Conversion
from trigpoint_vehicle.core.scene.world import Scene
from trigpoint_vehicle.core.table_manifest import parsed_manifest
from trigpoint_vehicle.core.table_rows import converted_tables, named_scans
from trigpoint_vehicle.core.victoria_park import GPS, INPUTS, MEASUREMENTS, victoria_park
from trigpoint_vehicle.kitti_files import kitti_drive
from trigpoint_vehicle.ros_bags import BagChoice, bag_drive, opened_bag
from trigpoint_vehicle.settings import SimulationSettings
from trigpoint_vehicle.source_files import read_source

TRUTH_NAME, OBJECTS_NAME, ANCHORS_NAME = "truth.csv", "objects.csv", "anchors.geojson"
CAST_AHEAD = 3  # groups of sweeps for each core, while the ones before are written

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """The files of a conversion; `truth`, `anchors` and `objects` None where the source has none."""

    logs: tuple[Path, ...]
    truth: Path | None
    anchors: Path | None
    objects: Path | None = None
    left_aside: LeftAside = field(default_factory=LeftAside)
    pictures: tuple[PictureFolder, ...] = ()


def write_conversion(conversion: Conversion, out_dir: Path, scans: VehicleScans | None = None) -> Written:
    """One `<vehicle>.mcap` a vehicle, with its `scans` read one by one, `truth.csv`, `objects.csv` and
    `anchors.geojson` where there are any.

    Raises InputError for a folder that cannot be written, AppendFailed for a log.
    """
    for remark in conversion.remarks:
        logger.warning(remark)
    known = conversion.truth
    has_truth = bool(known.paths or known.landmarks or known.labels or known.fixes)
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
        logs = tuple(_written_logs(conversion, out_dir, scans or VehicleScans()))
        anchors = anchors_geojson(conversion.anchors) if conversion.anchors else None
        return Written(
            logs=logs,
            truth=_written(out_dir / TRUTH_NAME, truth_lines(known)) if has_truth else None,
            anchors=None if anchors is None else _written(out_dir / ANCHORS_NAME, anchors),
            objects=_written(out_dir / OBJECTS_NAME, object_lines(conversion.objects)) if conversion.objects else None,
            left_aside=LeftAside() if scans is None else scans.left_aside,
        )
    except OSError as error:
        raise InputError(f"{out_dir}: cannot be written: {error}") from error


def _written(path: Path, parts: Iterable[str]) -> Path:
    path.write_text("".join(parts), encoding="utf-8")
    return path


def _written_logs(conversion: Conversion, out_dir: Path, scans: VehicleScans) -> list[Path]:
    logs = []
    for recording in tqdm(conversion.recordings, desc="writing logs", unit="vehicle", disable=None):
        path = out_dir / f"{recording.vehicle}.mcap"
        write_vehicle_log(path, scans.rows_of(recording), vehicle=recording.vehicle)
        logs.append(path)
    return logs


def convert_victoria_park(source: Path, out_dir: Path) -> Written:
    """The Victoria Park drive of a folder as a log. Raises InputError."""
    gps, inputs, measurements = (read_source(source, name) for name in (GPS, INPUTS, MEASUREMENTS))
    return write_conversion(victoria_park(gps, inputs, measurements), out_dir)


def convert_mrclam(source: Path, out_dir: Path) -> Written:
    """A UTIAS multi-robot set of a folder as logs, truth and anchors. Raises InputError."""
    if not source.is_dir():
        raise InputError(f"{source}: not a folder")
    robots = robot_numbers(path.name for path in source.iterdir())
    if not robots:
        raise InputError(f"{source}: no RobotN_Odometry.dat here")
    sources = [_robot_sources(source, robot) for robot in tqdm(robots, desc="reading", unit="robot", disable=None)]
    conversion = mrclam(sources, read_source(source, BARCODES), read_source(source, LANDMARKS))
    return write_conversion(conversion, out_dir)


def _robot_sources(source: Path, robot: int) -> RobotSources:
    odometry, measurement, truth = (read_source(source, name) for name in robot_files(robot))
    return RobotSources(robot=robot, odometry=odometry, measurement=measurement, truth=truth)


def convert_kitti(source: Path, out_dir: Path) -> WrittenClouds:
    """The KITTI raw drive of a folder as a log. Raises InputError."""
    return write_cloud_drive(kitti_drive(source), out_dir)


def convert_bag(source: Path, out_dir: Path, choice: BagChoice) -> WrittenClouds:
    """A ROS bag, of ROS 1 or 2, as a log. Raises InputError."""
    with opened_bag(source) as reader:
        return write_cloud_drive(bag_drive(reader, source, choice), out_dir)


def convert_table(manifest_path: Path, out_dir: Path, *, data_dir: Path | None = None) -> Written:
    """The tables a manifest describes as logs, truth and anchors; `data_dir` replaces the manifest's.

    Raises InputError.
    """
    text = read_source(manifest_path.parent, manifest_path.name)
    manifest = parsed_manifest(text.name, text.text)
    folder = data_dir or manifest_path.parent / manifest.data_dir
    names = tqdm(manifest.files(), desc="reading", unit="file", disable=None)
    sources = [listed_files(folder, name) if "*" in name else read_source(folder, name) for name in names]
    conversion = converted_tables(manifest, text.text, sources)
    return write_conversion(conversion, out_dir, VehicleScans(folder, named_scans(manifest, sources)))


def record_campus(settings: SimulationSettings, out_dir: Path, *, aerial: Path | None = None) -> Written:
    """The simulated campus of a seed as logs, truth and anchors, and with pictures of it in the folder `aerial`.

    Raises InputError.
    """
    with tqdm(total=settings.vehicles, desc="driving", unit="vehicle", disable=None) as bar:
        campus = simulate_campus(settings.seed, settings.campus(), progress=lambda done, total: bar.update())
    written, scene = _written_campus(campus, settings, out_dir)
    if aerial is None:
        return written
    pictures = aerial_pictures(campus, settings.campus(), seed=settings.seed, scene=scene)
    count = len(campus.imagery.image)
    return replace(
        written,
        pictures=write_pictures(tqdm(pictures, total=count, desc="drawing", unit="picture", disable=None), aerial),
    )


def _written_campus(campus: Campus, settings: SimulationSettings, out_dir: Path) -> tuple[Written, Scene | None]:
    carried = settings.carried_lidar()
    if carried is None:
        return write_conversion(conversion_of(campus), out_dir), None
    with casting_ahead() as casting:
        scanned = scanned_campus(campus, settings.campus(), carried, seed=settings.seed, casting=casting)
        return write_conversion(conversion_with_points(scanned), out_dir), scanned.scene


@contextmanager
def casting_ahead() -> Iterator[Casting]:
    """What casts sweeps on all cores while those before them are written, a bounded number ahead and in order."""
    cores = os.cpu_count() or 1
    with ThreadPoolExecutor(max_workers=cores) as pool:

        def casting(cast: Callable[[int], list[PointsScanned]], firsts: Iterable[int]) -> Iterator[list[PointsScanned]]:
            waiting = iter(firsts)
            ahead = deque[Future[list[PointsScanned]]](
                pool.submit(cast, first) for first in islice(waiting, CAST_AHEAD * cores)
            )
            while ahead:
                yield ahead.popleft().result()
                ahead.extend(pool.submit(cast, first) for first in islice(waiting, 1))

        yield casting

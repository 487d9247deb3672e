"""The UTIAS multi-robot data sets (Leung et al., 2011): robots among barcodes, truth by motion capture."""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.observed import LandmarkDetection, VehicleDescribed, WheelSpeedMeasured
from trigpoint.events.truth import Truth, TruthLandmark, TruthPath
from trigpoint.geodesy.positions import GridPosition
from trigpoint_vehicle.core.recording import Conversion, Recording, Timed, boot_id_of, recording_of
from trigpoint_vehicle.core.source_frames import (
    SourceFrame,
    grid_headings_rad,
    local_frame_on_grid,
    wgs84_from_source,
)
from trigpoint_vehicle.core.sweep_events import sweeps_of
from trigpoint_vehicle.core.text_tables import WHITESPACE, SourceText, TextTable, text_table

BARCODES, LANDMARKS = "Barcodes.dat", "Landmark_Groundtruth.dat"
ROBOT_FILE = re.compile(r"Robot(\d+)_(Odometry|Measurement|Groundtruth)\.dat")
CRS = "EPSG:32617"
ORIGIN = GridPosition(623_400.0, 4_848_700.0)  # chosen: a hall in Toronto; the data say nothing of their place
SECOND_NS = 1_000_000_000
SURVEY_SIGMA_FLOOR_M = 0.001  # the files' 0.05 to 0.3 mm are the scatter of a mean, not the accuracy of the mark
BARCODE_KIND, VEHICLE_KIND = "barcode", "vehicle"


@dataclass(frozen=True, slots=True)
class _Subjects:
    """Which subject wears which barcode; those not surveyed as landmarks are robots."""

    barcode: tuple[int, ...]
    subject: tuple[int, ...]
    surveyed: frozenset[str]

    def seen_as(self, barcode: int) -> tuple[str, str] | None:
        """Kind and signature, or None for a barcode nobody wears."""
        if barcode not in self.barcode:
            return None
        subject = self.subject[self.barcode.index(barcode)]
        if f"landmark-{subject}" in self.surveyed:
            return BARCODE_KIND, f"landmark-{subject}"
        return VEHICLE_KIND, f"robot{subject}"


def robot_numbers(names: Iterable[str]) -> tuple[int, ...]:
    """The robots a folder has files of, sorted."""
    found = (ROBOT_FILE.fullmatch(name) for name in names)
    return tuple(sorted({int(match[1]) for match in found if match}))


def robot_files(robot: int) -> tuple[str, str, str]:
    """A robot's odometry, measurement and truth files."""
    return f"Robot{robot}_Odometry.dat", f"Robot{robot}_Measurement.dat", f"Robot{robot}_Groundtruth.dat"


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotSources:
    """One robot's files."""

    robot: int
    odometry: SourceText
    measurement: SourceText
    truth: SourceText


def _stamps(table: TextTable) -> list[int]:
    stamps: list[int] = table.stamps_ns("t", unit_ns=SECOND_NS, epoch_ns=0).tolist()
    return stamps


def _whole(table: TextTable, column: str) -> list[int]:
    return [_whole_number(table, column, row, text) for row, text in enumerate(table.texts(column))]


def _whole_number(table: TextTable, column: str, row: int, text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise table.refused(row, column, "not a whole number") from None


def _subjects(source: SourceText, anchors: Iterable[AnchorLabelled]) -> _Subjects:
    table = text_table(source, columns=("subject", "barcode"), delimiter=WHITESPACE)
    return _Subjects(
        tuple(_whole(table, "barcode")),
        tuple(_whole(table, "subject")),
        frozenset(anchor.signature for anchor in anchors),
    )


def _odometry(source: SourceText) -> list[Timed]:
    table = text_table(source, columns=("t", "v", "w"), delimiter=WHITESPACE)
    columns = zip(_stamps(table), table.numbers("v").tolist(), table.numbers("w").tolist(), strict=True)
    return [
        (stamp, WheelSpeedMeasured(speed_mps=v, steering_rad=math.nan, yaw_rate_radps=w)) for stamp, v, w in columns
    ]


def _sightings(source: SourceText, subjects: _Subjects) -> tuple[list[Timed], int]:
    table = text_table(source, columns=("t", "barcode", "range", "bearing"), delimiter=WHITESPACE)
    stamps, detections, misread = list[int](), list[LandmarkDetection](), 0
    columns = zip(
        _stamps(table),
        _whole(table, "barcode"),
        table.numbers("range").tolist(),
        table.numbers("bearing").tolist(),
        strict=True,
    )
    for stamp, barcode, range_m, bearing_rad in columns:
        worn = subjects.seen_as(barcode)
        if worn is None:
            misread += 1
            continue
        stamps.append(stamp)
        detections.append(LandmarkDetection(range_m, bearing_rad, *worn, math.nan))
    return sweeps_of(stamps, detections), misread


def _described(robot: int) -> VehicleDescribed:
    return VehicleDescribed(
        vehicle=f"robot{robot}",
        landmark_sensor_model="camera",  # ranges come from the height of barcodes in the image
        declared_crs=CRS,
        declared_origin_easting_m=ORIGIN.easting_m,
        declared_origin_northing_m=ORIGIN.northing_m,
        software="trigpoint convert mrclam",
    )


def _recording(sources: RobotSources, subjects: _Subjects) -> tuple[Recording, str]:
    sweeps, misread = _sightings(sources.measurement, subjects)
    boot_id = boot_id_of(sources.odometry.text.encode(), sources.measurement.text.encode())
    recording = recording_of(_described(sources.robot), _odometry(sources.odometry) + sweeps, boot_id=boot_id)
    remark = f"robot{sources.robot}: {misread} sightings of barcodes nobody wears were left out" if misread else ""
    return recording, remark


def _path(sources: RobotSources, frame: SourceFrame) -> TruthPath:
    table = text_table(sources.truth, columns=("t", "x", "y", "heading"), delimiter=WHITESPACE)
    x_m, y_m = table.numbers("x"), table.numbers("y")
    lat_deg, lon_deg = wgs84_from_source(x_m, y_m, frame)
    return TruthPath(
        vehicle=f"robot{sources.robot}",
        stamp_ns=table.stamps_ns("t", unit_ns=SECOND_NS, epoch_ns=0),
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        heading_rad=grid_headings_rad(x_m, y_m, table.numbers("heading"), frame, map_crs=CRS),
    )


def _surveyed(source: SourceText, frame: SourceFrame) -> tuple[AnchorLabelled, ...]:
    table = text_table(source, columns=("subject", "x", "y", "x_sigma", "y_sigma"), delimiter=WHITESPACE)
    lat_deg, lon_deg = wgs84_from_source(table.numbers("x"), table.numbers("y"), frame)
    columns = zip(
        _whole(table, "subject"),
        lat_deg.tolist(),
        lon_deg.tolist(),
        table.numbers("x_sigma").tolist(),
        table.numbers("y_sigma").tolist(),
        strict=True,
    )
    return tuple(
        AnchorLabelled(
            anchor=f"survey-{subject}",
            lat_deg=lat,
            lon_deg=lon,
            sigma_m=max(x_sigma_m, y_sigma_m, SURVEY_SIGMA_FLOOR_M),
            image="survey",
            image_sigma_m=0.0,
            kind=BARCODE_KIND,
            signature=f"landmark-{subject}",
            source_crs=CRS,
            operation="local frame placed at a declared origin",
        )
        for subject, lat, lon, x_sigma_m, y_sigma_m in columns
    )


def _landmark(anchor: AnchorLabelled) -> TruthLandmark:
    name = anchor.signature
    return TruthLandmark(landmark=name, lat_deg=anchor.lat_deg, lon_deg=anchor.lon_deg, signature=name)


def mrclam(robots: Sequence[RobotSources], barcodes: SourceText, landmarks: SourceText) -> Conversion:
    """All robots' events, their true paths, and the surveyed landmarks as anchors and as truth.

    Raises InputError naming file, row and value.
    """
    frame = local_frame_on_grid(CRS, ORIGIN)
    anchors = _surveyed(landmarks, frame)
    subjects = _subjects(barcodes, anchors)
    recorded = [_recording(sources, subjects) for sources in robots]
    return Conversion(
        recordings=tuple(recording for recording, _ in recorded),
        truth=Truth(
            paths=tuple(_path(sources, frame) for sources in robots),
            landmarks=tuple(_landmark(anchor) for anchor in anchors),
        ),
        anchors=anchors,
        remarks=tuple(remark for _, remark in recorded if remark),
    )

"""A manifest's tables turned into events, truth and anchors."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.observed import (
    GnssFixReceived,
    ImuMeasured,
    LandmarkDetection,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint.events.truth import Truth, TruthLandmark, TruthPath
from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.projection import utm_crs
from trigpoint_vehicle.core.manifest_quantities import Quantity
from trigpoint_vehicle.core.recording import Conversion, Recording, Timed, boot_id_of, recording_of
from trigpoint_vehicle.core.source_frames import SourceFrame, grid_headings_rad, wgs84_from_source
from trigpoint_vehicle.core.source_times import UNIT_NS, leap_correction_ns, unix_ns
from trigpoint_vehicle.core.sweep_events import sweeps_of
from trigpoint_vehicle.core.table_manifest import (
    Anchors,
    Clock,
    Detections,
    FilePart,
    Fixes,
    Heading,
    Inertial,
    Manifest,
    PositionPart,
    TimeColumn,
    TrueLandmarks,
    TruePath,
    Vehicle,
    WheelPairs,
    WheelSpeeds,
)
from trigpoint_vehicle.core.text_tables import SourceText, TextTable, text_table

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class _Reading:
    """A manifest beside the texts of its files."""

    manifest: Manifest
    file: tuple[str, ...]
    text: tuple[SourceText, ...]

    def source(self, part: FilePart, vehicle: Vehicle | None = None) -> SourceText:
        return self.text[self.file.index(part.file or (vehicle.file if vehicle else ""))]

    def table(self, part: FilePart, vehicle: Vehicle | None = None) -> TextTable:
        source = self.source(part, vehicle)
        return text_table(source, columns=part.columns, delimiter=part.delimiter, comment=part.comment)

    def clock(self, vehicle: Vehicle) -> Clock:
        return vehicle.clock or self.manifest.clock

    def frame(self, part: PositionPart) -> SourceFrame:
        return (part.frame or self.manifest.frame).source_frame()


def _stamps_ns(table: TextTable, time: TimeColumn, clock: Clock) -> Ints:
    epoch_ns = unix_ns(clock.second_zero()) + round(time.offset_s * UNIT_NS["s"])
    stamps = table.stamps_ns(time.column, unit_ns=UNIT_NS[time.unit], epoch_ns=epoch_ns)
    if clock.scale == "utc" or len(stamps) == 0:
        return stamps
    # a drive is short: the leap seconds of its first instant serve for all of it
    return stamps + leap_correction_ns(int(stamps.min()), clock.scale)


def _numbers(quantity: Quantity | None, table: TextTable) -> Floats:
    return np.full(len(table.line_number), np.nan) if quantity is None else quantity.of(table)


def _coordinates(part: PositionPart, table: TextTable, frame: SourceFrame) -> tuple[Floats, Floats]:
    # x or longitude first, as the frame wants them
    given_in_degrees = part.lat is not None
    if given_in_degrees != frame.in_degrees:
        wanted = "lat and lon" if frame.in_degrees else "east and north"
        raise InputError(f"{table.source}: its frame {frame.crs!r} needs {wanted}")
    x, y = (part.lon, part.lat) if given_in_degrees else (part.east, part.north)
    return _numbers(x, table), _numbers(y, table)


def _positions(part: PositionPart, table: TextTable, frame: SourceFrame) -> tuple[Floats, Floats]:
    return wgs84_from_source(*_coordinates(part, table, frame), frame)


def _kept(stamps: Ints, *columns: Floats, needed: int) -> list[tuple[int, ...]]:
    # rows whose first `needed` columns are all numbers
    known = np.isfinite(np.column_stack(columns[:needed])).all(axis=1)
    return list(zip(stamps[known].tolist(), *(column[known].tolist() for column in columns), strict=True))


def _fixes(reading: _Reading, vehicle: Vehicle, part: Fixes) -> list[Timed]:
    table = reading.table(part, vehicle)
    lat, lon = _positions(part, table, reading.frame(part))
    rows = _kept(
        _stamps_ns(table, part.time, reading.clock(vehicle)),
        lat,
        lon,
        _numbers(part.height, table),
        _numbers(part.sigma, table),
        needed=2,
    )
    return [(t, GnssFixReceived(lat_deg=lat, lon_deg=lon, height_m=h, sigma_m=s)) for t, lat, lon, h, s in rows]


def _wheel_speeds(reading: _Reading, vehicle: Vehicle, part: WheelSpeeds) -> list[Timed]:
    table = reading.table(part, vehicle)
    stamps = _stamps_ns(table, part.time, reading.clock(vehicle))
    turning = (_numbers(part.steering, table), _numbers(part.yaw_rate, table))
    rows = _kept(stamps, part.speed.of(table), *turning, needed=1)
    return [(t, WheelSpeedMeasured(speed_mps=v, steering_rad=s, yaw_rate_radps=w)) for t, v, s, w in rows]


def _wheel_pairs(reading: _Reading, vehicle: Vehicle, part: WheelPairs) -> list[Timed]:
    table = reading.table(part, vehicle)
    stamps = _stamps_ns(table, part.time, reading.clock(vehicle))
    rows = _kept(stamps, part.left.of(table), part.right.of(table), needed=2)
    return [(t, WheelPairMeasured(left_mps=left, right_mps=right)) for t, left, right in rows]


def _inertial(reading: _Reading, vehicle: Vehicle, part: Inertial) -> list[Timed]:
    table = reading.table(part, vehicle)
    stamps = _stamps_ns(table, part.time, reading.clock(vehicle))
    pulls = (_numbers(part.acceleration_x, table), _numbers(part.acceleration_y, table))
    rows = _kept(stamps, part.yaw_rate.of(table), *pulls, needed=1)
    return [(t, ImuMeasured(yaw_rate_radps=w, acceleration_x_mps2=x, acceleration_y_mps2=y)) for t, w, x, y in rows]


def _polar(vehicle: Vehicle, part: Detections, table: TextTable) -> tuple[Floats, Floats]:
    if part.range is not None and part.bearing is not None:
        return part.range.of(table), part.bearing.of(table)
    sensor = vehicle.geometry
    ahead = _numbers(part.x, table) - sensor.landmark_sensor_x_m
    left = _numbers(part.y, table) - sensor.landmark_sensor_y_m
    return np.hypot(ahead, left), np.arctan2(left, ahead) - sensor.landmark_sensor_yaw_rad


def _sweeps(reading: _Reading, vehicle: Vehicle, part: Detections) -> list[Timed]:
    table = reading.table(part, vehicle)
    range_m, bearing_rad = _polar(vehicle, part, table)
    bearing_rad = (bearing_rad + math.pi) % (2.0 * math.pi) - math.pi
    columns = zip(
        range_m.tolist(),
        bearing_rad.tolist(),
        part.kind.of(table),
        part.signature.of(table),
        _numbers(part.diameter, table).tolist(),
        strict=True,
    )
    detections = [LandmarkDetection(*row) if math.isfinite(row[0] + row[1]) else None for row in columns]
    return sweeps_of(_stamps_ns(table, part.time, reading.clock(vehicle)).tolist(), detections)


def _described(manifest: Manifest, vehicle: Vehicle) -> VehicleDescribed:
    origin = manifest.frame.on_grid if manifest.frame.kind == "local" else None
    return VehicleDescribed(
        vehicle=vehicle.name,
        declared_crs=manifest.frame.crs if origin else manifest.map_crs,
        declared_origin_easting_m=origin.easting_m if origin else 0.0,
        declared_origin_northing_m=origin.northing_m if origin else 0.0,
        software="trigpoint convert table",
        **vehicle.geometry.model_dump(),
    )


def _recording(reading: _Reading, vehicle: Vehicle, manifest_text: str) -> Recording:
    timed: list[Timed] = []
    for fixes in vehicle.fixes:
        timed += _fixes(reading, vehicle, fixes)
    for speeds in vehicle.wheel_speeds:
        timed += _wheel_speeds(reading, vehicle, speeds)
    for pairs in vehicle.wheel_pairs:
        timed += _wheel_pairs(reading, vehicle, pairs)
    for inertial in vehicle.inertial:
        timed += _inertial(reading, vehicle, inertial)
    for detections in vehicle.detections:
        timed += _sweeps(reading, vehicle, detections)
    used = dict.fromkeys(reading.source(part, vehicle).text for part in vehicle.parts())
    boot_id = boot_id_of(vehicle.name.encode(), manifest_text.encode(), *(text.encode() for text in used))
    return recording_of(_described(reading.manifest, vehicle), timed, boot_id=boot_id)


def _east_based_rad(heading: Heading, table: TextTable) -> Floats:
    raw = table.numbers(heading.column)
    turned = np.radians(raw) if heading.unit == "deg" else raw
    turned = -turned if heading.turn == "clockwise" else turned
    return turned + (0.5 * math.pi if heading.zero == "north" else 0.0)


def _true_path(reading: _Reading, vehicle: Vehicle, part: TruePath, map_crs: str) -> TruthPath:
    table, frame = reading.table(part, vehicle), reading.frame(part)
    x, y = _coordinates(part, table, frame)
    lat_deg, lon_deg = wgs84_from_source(x, y, frame)
    heading_rad = np.full(len(x), np.nan)
    if part.heading is not None:
        heading_rad = grid_headings_rad(x, y, _east_based_rad(part.heading, table), frame, map_crs=map_crs)
    stamp_ns = _stamps_ns(table, part.time, reading.clock(vehicle))
    order = np.argsort(stamp_ns, kind="stable")
    order = order[np.isfinite(lat_deg[order])]
    return TruthPath(
        vehicle=vehicle.name,
        stamp_ns=stamp_ns[order],
        lat_deg=lat_deg[order],
        lon_deg=lon_deg[order],
        heading_rad=heading_rad[order],
    )


def _map_crs(reading: _Reading, recordings: Sequence[Recording]) -> str:
    # the zone of the first fix, as a map without a declared CRS pins it
    if reading.manifest.map_crs or reading.manifest.frame.on_grid:
        return reading.manifest.map_crs or reading.manifest.frame.crs
    for recording in recordings:
        for row in recording.rows:
            if isinstance(row.event, GnssFixReceived):
                return utm_crs(Wgs84Position(row.event.lat_deg, row.event.lon_deg))
    for vehicle in reading.manifest.vehicle:
        for part in vehicle.true_path:
            lat, lon = _positions(part, reading.table(part, vehicle), reading.frame(part))
            known = np.flatnonzero(np.isfinite(lat))
            if len(known):
                return utm_crs(Wgs84Position(float(lat[known[0]]), float(lon[known[0]])))
    return ""


def _true_landmarks(reading: _Reading, part: TrueLandmarks) -> list[TruthLandmark]:
    table = reading.table(part)
    lat, lon = _positions(part, table, reading.frame(part))
    columns = zip(part.name.of(table), lat.tolist(), lon.tolist(), part.signature.of(table), strict=True)
    return [
        TruthLandmark(landmark=name, lat_deg=lat, lon_deg=lon, signature=signature)
        for name, lat, lon, signature in columns
        if math.isfinite(lat)
    ]


def _anchors(reading: _Reading, part: Anchors) -> list[AnchorLabelled]:
    table, frame = reading.table(part), reading.frame(part)
    lat, lon = _positions(part, table, frame)
    image_sigma_m = part.image_sigma.of(table) if part.image_sigma else np.zeros(len(lat))
    sigma_m = part.sigma.of(table)
    known = np.flatnonzero(np.isfinite(lat)).tolist()
    lacking = [row for row in known if not (sigma_m[row] > 0.0 and image_sigma_m[row] >= 0.0)]
    if lacking:
        raise InputError(f"{table.source}, row {table.line_number[lacking[0]]}: an anchor needs a sigma above 0")
    names, images = part.name.of(table), part.image.of(table)
    kinds, signatures = part.kind.of(table), part.signature.of(table)
    return [
        AnchorLabelled(
            anchor=names[row],
            lat_deg=float(lat[row]),
            lon_deg=float(lon[row]),
            sigma_m=float(sigma_m[row]),
            image=images[row],
            image_sigma_m=float(image_sigma_m[row]),
            kind=kinds[row],
            signature=signatures[row],
            source_crs=frame.crs,
            operation="trigpoint convert table",
        )
        for row in known
    ]


def converted_tables(manifest: Manifest, manifest_text: str, texts: Sequence[SourceText]) -> Conversion:
    """What a manifest's tables hold; `texts` are those of `manifest.files()`, in that order.

    Raises InputError naming file, row and value; FrameRefused for a CRS that is not known or not usable.
    """
    reading = _Reading(manifest, manifest.files(), tuple(texts))
    recordings = tuple(_recording(reading, vehicle, manifest_text) for vehicle in manifest.vehicle)
    map_crs = _map_crs(reading, recordings)
    return Conversion(
        recordings=recordings,
        truth=Truth(
            paths=tuple(
                _true_path(reading, vehicle, part, map_crs)
                for vehicle in manifest.vehicle
                for part in vehicle.true_path
            ),
            landmarks=tuple(mark for part in manifest.true_landmarks for mark in _true_landmarks(reading, part)),
        ),
        anchors=tuple(anchor for part in manifest.anchors for anchor in _anchors(reading, part)),
    )

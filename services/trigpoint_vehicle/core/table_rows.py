"""A manifest's tables turned into events, truth and anchors."""

import math
from collections.abc import Sequence

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
from trigpoint_vehicle.core.recording import Conversion, Recording, Timed, boot_id_of, recording_of
from trigpoint_vehicle.core.scan_rows import ScanSource, scan_source
from trigpoint_vehicle.core.source_frames import grid_headings_rad, wgs84_from_source
from trigpoint_vehicle.core.sweep_events import sweeps_of
from trigpoint_vehicle.core.table_manifest import (
    Anchors,
    Detections,
    Fixes,
    Heading,
    Inertial,
    Manifest,
    TrueLandmarks,
    TruePath,
    Vehicle,
    WheelPairs,
    WheelSpeeds,
)
from trigpoint_vehicle.core.table_place import DeclaredPlace, declared_place, expected_map_crs
from trigpoint_vehicle.core.table_reading import Reading, coordinates, numbers, positions, stamps_ns
from trigpoint_vehicle.core.text_tables import SourceText, TextTable

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def _kept(stamps: Ints, *columns: Floats, needed: int) -> list[tuple[int, ...]]:
    # rows whose first `needed` columns are all numbers
    known = np.isfinite(np.column_stack(columns[:needed])).all(axis=1)
    return list(zip(stamps[known].tolist(), *(column[known].tolist() for column in columns), strict=True))


def _fixes(reading: Reading, vehicle: Vehicle, part: Fixes) -> list[Timed]:
    table = reading.table(part, vehicle)
    lat, lon = positions(part, table, reading.frame(part))
    rows = _kept(
        stamps_ns(table, part.time, reading.clock(vehicle)),
        lat,
        lon,
        numbers(part.height, table),
        numbers(part.sigma, table),
        needed=2,
    )
    return [(t, GnssFixReceived(lat_deg=lat, lon_deg=lon, height_m=h, sigma_m=s)) for t, lat, lon, h, s in rows]


def _wheel_speeds(reading: Reading, vehicle: Vehicle, part: WheelSpeeds) -> list[Timed]:
    table = reading.table(part, vehicle)
    stamps = stamps_ns(table, part.time, reading.clock(vehicle))
    turning = (numbers(part.steering, table), numbers(part.yaw_rate, table))
    rows = _kept(stamps, part.speed.of(table), *turning, needed=1)
    return [(t, WheelSpeedMeasured(speed_mps=v, steering_rad=s, yaw_rate_radps=w)) for t, v, s, w in rows]


def _wheel_pairs(reading: Reading, vehicle: Vehicle, part: WheelPairs) -> list[Timed]:
    table = reading.table(part, vehicle)
    stamps = stamps_ns(table, part.time, reading.clock(vehicle))
    rows = _kept(stamps, part.left.of(table), part.right.of(table), needed=2)
    return [(t, WheelPairMeasured(left_mps=left, right_mps=right)) for t, left, right in rows]


def _inertial(reading: Reading, vehicle: Vehicle, part: Inertial) -> list[Timed]:
    table = reading.table(part, vehicle)
    stamps = stamps_ns(table, part.time, reading.clock(vehicle))
    pulls = (numbers(part.acceleration_x, table), numbers(part.acceleration_y, table))
    rows = _kept(stamps, part.yaw_rate.of(table), *pulls, needed=1)
    return [(t, ImuMeasured(yaw_rate_radps=w, acceleration_x_mps2=x, acceleration_y_mps2=y)) for t, w, x, y in rows]


def _polar(vehicle: Vehicle, part: Detections, table: TextTable) -> tuple[Floats, Floats]:
    if part.range is not None and part.bearing is not None:
        return part.range.of(table), part.bearing.of(table)
    sensor = vehicle.geometry
    ahead = numbers(part.x, table) - sensor.landmark_sensor_x_m
    left = numbers(part.y, table) - sensor.landmark_sensor_y_m
    return np.hypot(ahead, left), np.arctan2(left, ahead) - sensor.landmark_sensor_yaw_rad


def _sweeps(reading: Reading, vehicle: Vehicle, part: Detections) -> list[Timed]:
    table = reading.table(part, vehicle)
    range_m, bearing_rad = _polar(vehicle, part, table)
    bearing_rad = (bearing_rad + math.pi) % (2.0 * math.pi) - math.pi
    columns = zip(
        range_m.tolist(),
        bearing_rad.tolist(),
        part.kind.of(table),
        part.signature.of(table),
        numbers(part.diameter, table).tolist(),
        strict=True,
    )
    detections = [LandmarkDetection(*row) if math.isfinite(row[0] + row[1]) else None for row in columns]
    return sweeps_of(stamps_ns(table, part.time, reading.clock(vehicle)).tolist(), detections)


def _described(vehicle: Vehicle, place: DeclaredPlace | None) -> VehicleDescribed:
    return VehicleDescribed(
        vehicle=vehicle.name,
        declared_crs=place.crs if place else "",
        declared_origin_easting_m=place.origin.easting_m if place else 0.0,
        declared_origin_northing_m=place.origin.northing_m if place else 0.0,
        software="trigpoint convert table",
        **vehicle.geometry.model_dump(),
    )


def _recording(reading: Reading, vehicle: Vehicle, place: DeclaredPlace | None, manifest_text: str) -> Recording:
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
    return recording_of(_described(vehicle, place), timed, boot_id=boot_id)


def _east_based_rad(heading: Heading, table: TextTable) -> Floats:
    raw = table.numbers(heading.column)
    turned = np.radians(raw) if heading.unit == "deg" else raw
    turned = -turned if heading.turn == "clockwise" else turned
    return turned + (0.5 * math.pi if heading.zero == "north" else 0.0)


def _true_path(reading: Reading, vehicle: Vehicle, part: TruePath, map_crs: str) -> TruthPath:
    table, frame = reading.table(part, vehicle), reading.frame(part)
    x, y = coordinates(part, table, frame)
    lat_deg, lon_deg = wgs84_from_source(x, y, frame)
    heading_rad = np.full(len(x), np.nan)
    if part.heading is not None:
        heading_rad = grid_headings_rad(x, y, _east_based_rad(part.heading, table), frame, map_crs=map_crs)
    stamp_ns = stamps_ns(table, part.time, reading.clock(vehicle))
    order = np.argsort(stamp_ns, kind="stable")
    order = order[np.isfinite(lat_deg[order])]
    return TruthPath(
        vehicle=vehicle.name,
        stamp_ns=stamp_ns[order],
        lat_deg=lat_deg[order],
        lon_deg=lon_deg[order],
        heading_rad=heading_rad[order],
    )


def _true_landmarks(reading: Reading, part: TrueLandmarks) -> list[TruthLandmark]:
    table = reading.table(part)
    lat, lon = positions(part, table, reading.frame(part))
    columns = zip(part.name.of(table), lat.tolist(), lon.tolist(), part.signature.of(table), strict=True)
    return [
        TruthLandmark(landmark=name, lat_deg=lat, lon_deg=lon, signature=signature)
        for name, lat, lon, signature in columns
        if math.isfinite(lat)
    ]


def _anchors(reading: Reading, part: Anchors) -> list[AnchorLabelled]:
    table, frame = reading.table(part), reading.frame(part)
    lat, lon = positions(part, table, frame)
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
    reading = Reading(manifest, manifest.files(), tuple(texts))
    place = declared_place(reading)
    recordings = tuple(_recording(reading, vehicle, place, manifest_text) for vehicle in manifest.vehicle)
    map_crs = expected_map_crs(reading, place)
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


def named_scans(manifest: Manifest, texts: Sequence[SourceText]) -> dict[str, tuple[ScanSource, ...]]:
    """The scans of each vehicle that has some; `texts` as for `converted_tables`. Raises InputError as that does."""
    reading = Reading(manifest, manifest.files(), tuple(texts))
    return {
        vehicle.name: tuple(scan_source(reading, vehicle, part) for part in vehicle.sweeps)
        for vehicle in manifest.vehicle
        if vehicle.sweeps
    }

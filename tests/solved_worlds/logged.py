"""A world's drives and labels as events in a log, as ingest would have appended them."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from solved_worlds.examples import FRAME, World
from trigpoint.events.codec import Event
from trigpoint.events.drives import Drive
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.estimated import FixJudged
from trigpoint.events.observed import (
    GnssFixReceived,
    ImuMeasured,
    LandmarkDetection,
    LandmarksDetected,
    MapFramePinned,
    WheelSpeedMeasured,
)
from trigpoint.logs.ports import EventLog


def append_world(log: EventLog, world: World) -> None:
    """The frame, every drive in a stream of its vehicle's, and the labels."""
    pinned = MapFramePinned(
        crs=FRAME.crs,
        origin_easting_m=FRAME.origin_easting_m,
        origin_northing_m=FRAME.origin_northing_m,
        declared_by="test",
    )
    log.append("map", [Envelope(EventIdentity("ingest", "map-frame", 0), 0, pinned)])
    for drive in world.drives:
        log.append(f"veh-{drive.vehicle}", drive_rows(drive))
    labels = [Envelope(EventIdentity("anchors", "file", n), 0, label) for n, label in enumerate(world.anchors)]
    if labels:
        log.append("corrections", labels)


def drive_rows(drive: Drive) -> list[Envelope[Event]]:
    """A drive's events in order of time, numbered from 0."""
    wheels, imu, fixes = drive.wheels, drive.imu, drive.fixes
    events: list[tuple[int, Event]] = [(int(wheels.stamp_ns[0]), drive.described)]
    events += [
        (int(stamp_ns), WheelSpeedMeasured(speed_mps=float(speed), steering_rad=math.nan, yaw_rate_radps=math.nan))
        for stamp_ns, speed in zip(wheels.stamp_ns, wheels.speed_mps, strict=True)
    ]
    events += [
        (int(stamp_ns), replace(_STILL, yaw_rate_radps=float(rate)))
        for stamp_ns, rate in zip(imu.stamp_ns, imu.yaw_rate_radps, strict=True)
    ]
    events += [
        (int(stamp_ns), GnssFixReceived(lat_deg=float(lat), lon_deg=float(lon), height_m=0.0, sigma_m=math.nan))
        for stamp_ns, lat, lon in zip(fixes.stamp_ns, fixes.lat_deg, fixes.lon_deg, strict=True)
    ]
    events += _sweeps(drive)
    events.sort(key=lambda row: row[0])
    return [
        Envelope(EventIdentity(drive.vehicle, drive.boot_id, sequence), stamp_ns, event)
        for sequence, (stamp_ns, event) in enumerate(events)
    ]


def all_accepted(rows: Sequence[Envelope[Any]]) -> list[FixJudged]:
    """The filter's word that every fix among a drive's events holds."""
    return [
        FixJudged(
            vehicle=row.identity.source,
            boot_id=row.identity.boot_id,
            fix_sequence=row.identity.sequence,
            accepted=True,
            reason="inside gate",
            nis=1.0,
            limit=5.99,
            innovation_x_m=0.0,
            innovation_y_m=0.0,
        )
        for row in rows
        if isinstance(row.event, GnssFixReceived)
    ]


_STILL = ImuMeasured(yaw_rate_radps=0.0, acceleration_x_mps2=math.nan, acceleration_y_mps2=math.nan)


def _sweeps(drive: Drive) -> list[tuple[int, Event]]:
    seen = drive.detections
    sweeps = []
    for stamp_ns in np.unique(seen.stamp_ns):
        rows = np.nonzero(seen.stamp_ns == stamp_ns)[0]
        detections = tuple(
            LandmarkDetection(
                range_m=float(seen.range_m[row]),
                bearing_rad=float(seen.bearing_rad[row]),
                kind=seen.kind[row],
                signature=seen.signature[row],
                diameter_m=float(seen.diameter_m[row]),
            )
            for row in rows
        )
        sweeps.append((int(stamp_ns), LandmarksDetected(detections=detections)))
    return list(sweeps)

"""Vehicles that drive through the street with a lidar, as events."""

import math
from collections.abc import Iterator

import numpy as np

from scanned_worlds.casting import PERIOD_NS, SIXTEEN, START_NS, STREET, World, driven_pose, swept
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import GnssFixReceived, VehicleDescribed, WheelSpeedMeasured
from trigpoint.geodesy.projection import MapFrame, wgs84_from_map_points

VELOCITY = (6.0, 0.2)  # m/s, rad/s
FIX_NS = 500_000_000


def scanned_drive(
    vehicle: str, sweeps: int, *, boot_id: str = "boot-1", world: World = STREET
) -> Iterator[Envelope[Event]]:
    """A described vehicle with wheels and a 16-beam lidar: a speed and a sweep ten times a second."""

    def row(sequence: int, stamp_ns: int, event: Event) -> Envelope[Event]:
        return Envelope(EventIdentity(vehicle, boot_id, sequence), stamp_ns, event)

    yield row(0, START_NS, VehicleDescribed(vehicle=vehicle, wheelbase_m=2.7))
    speed = WheelSpeedMeasured(speed_mps=VELOCITY[0], steering_rad=math.nan, yaw_rate_radps=VELOCITY[1])
    for number in range(sweeps):
        stamp_ns = START_NS + number * PERIOD_NS
        scanned = swept(world, SIXTEEN, pose=driven_pose(VELOCITY, 0.1 * number), velocity=VELOCITY)
        yield row(2 * number + 1, stamp_ns, speed)
        yield row(2 * number + 2, stamp_ns, scanned)


def fixed_drive(vehicle: str, sweeps: int, frame: MapFrame, *, boot_id: str = "boot-1") -> list[Envelope[Event]]:
    """The same drive from the frame's origin on, with an exact fix twice a second that claims half a metre."""
    measured = [(row.stamp_ns, row.event) for row in scanned_drive(vehicle, sweeps, boot_id=boot_id)]
    stamps = range(START_NS, START_NS + sweeps * PERIOD_NS, FIX_NS)
    place_m = np.array([driven_pose(VELOCITY, (stamp_ns - START_NS) * 1e-9)[:2] for stamp_ns in stamps])
    lat_deg, lon_deg = wgs84_from_map_points(place_m, frame)
    fixes: list[tuple[int, Event]] = [
        (stamp_ns, GnssFixReceived(lat_deg=lat, lon_deg=lon, height_m=0.0, sigma_m=0.5))
        for stamp_ns, lat, lon in zip(stamps, lat_deg.tolist(), lon_deg.tolist(), strict=True)
    ]
    events = sorted([*measured, *fixes], key=lambda row: row[0])
    return [Envelope(EventIdentity(vehicle, boot_id, n), stamp, event) for n, (stamp, event) in enumerate(events)]

"""Vehicles that drive through the street with a lidar, as events."""

import math
from collections.abc import Iterator

from scanned_worlds.casting import PERIOD_NS, SIXTEEN, START_NS, STREET, driven_pose, swept
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import VehicleDescribed, WheelSpeedMeasured

VELOCITY = (6.0, 0.2)  # m/s, rad/s


def scanned_drive(vehicle: str, sweeps: int, *, boot_id: str = "boot-1") -> Iterator[Envelope[Event]]:
    """A described vehicle with wheels and a 16-beam lidar: a speed and a sweep ten times a second."""

    def row(sequence: int, stamp_ns: int, event: Event) -> Envelope[Event]:
        return Envelope(EventIdentity(vehicle, boot_id, sequence), stamp_ns, event)

    yield row(0, START_NS, VehicleDescribed(vehicle=vehicle, wheelbase_m=2.7))
    speed = WheelSpeedMeasured(speed_mps=VELOCITY[0], steering_rad=math.nan, yaw_rate_radps=VELOCITY[1])
    for number in range(sweeps):
        stamp_ns = START_NS + number * PERIOD_NS
        scanned = swept(STREET, SIXTEEN, pose=driven_pose(VELOCITY, 0.1 * number), velocity=VELOCITY)
        yield row(2 * number + 1, stamp_ns, speed)
        yield row(2 * number + 2, stamp_ns, scanned)

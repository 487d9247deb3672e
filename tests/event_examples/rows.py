"""Envelopes of a vehicle's observations, as many as asked for."""

from collections.abc import Sequence

from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import GnssFixReceived, ImuMeasured

START_NS = 1_700_000_000_000_000_000
STEP_NS = 10_000_000  # 100 Hz


def imu_row(sequence: int, *, vehicle: str = "van", boot_id: str = "boot-1") -> Envelope[Event]:
    """An IMU sample; the yaw rate is the sequence in hundredths."""
    event = ImuMeasured(yaw_rate_radps=sequence / 100.0, acceleration_x_mps2=0.1, acceleration_y_mps2=-0.2)
    return Envelope(EventIdentity(vehicle, boot_id, sequence), START_NS + sequence * STEP_NS, event)


def fix_row(sequence: int, *, vehicle: str = "van", boot_id: str = "boot-1") -> Envelope[Event]:
    """A GNSS fix in Sydney."""
    event = GnssFixReceived(lat_deg=-33.89, lon_deg=151.19, height_m=30.0, sigma_m=2.5)
    return Envelope(EventIdentity(vehicle, boot_id, sequence), START_NS + sequence * STEP_NS, event)


def imu_rows(first: int, stop: int, *, vehicle: str = "van") -> Sequence[Envelope[Event]]:
    """IMU samples of sequences [first, stop)."""
    return [imu_row(sequence, vehicle=vehicle) for sequence in range(first, stop)]

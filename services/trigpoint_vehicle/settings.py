"""What the vehicle service may be told."""

from dataclasses import dataclass, replace
from typing import Literal

from trigpoint.errors import InputError
from trigpoint.events.keys import DEFAULT_ROOT
from trigpoint_vehicle.core.campus_settings import CampusSettings, with_known_signatures
from trigpoint_vehicle.core.lidar_settings import CarriedLidar

VEHICLES_MAX = 50  # every one is driven and kept in memory at once: about 100 MB each


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationSettings:
    """Which campus to simulate and how many vehicles drive there, with a lidar or without, and with points only: no
    simulated detections. Raises InputError outside the limits."""

    seed: int = 1
    vehicles: int = 2
    known_signatures: bool = False
    lidar: bool = False
    points_only: bool = False

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise InputError(f"seed {self.seed}: seeds begin at 0")
        if not 1 <= self.vehicles <= VEHICLES_MAX:
            raise InputError(f"{self.vehicles} vehicles: between 1 and {VEHICLES_MAX} can be simulated")
        if self.points_only and not self.lidar:
            raise InputError("points only: only vehicles with a lidar have points")

    def campus(self) -> CampusSettings:
        """The campus's settings."""
        settings = CampusSettings(vehicles=self.vehicles)
        if self.points_only:
            settings = replace(settings, carried=replace(settings.carried, landmarks=False))
        return with_known_signatures(settings) if self.known_signatures else settings

    def carried_lidar(self) -> CarriedLidar | None:
        """The lidar on every vehicle, None where they carry none."""
        return CarriedLidar() if self.lidar else None


SEGMENTS_MIN = 8  # of a full spool: what is dropped goes segment by segment, and two of them are in use
MIB = 1024 * 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleSettings:
    """How a vehicle keeps and sends its messages. Raises InputError outside the limits.

    The spool holds at most `spool_limit_bytes`, in files of `segment_bytes`; `when_full` it refuses new messages or
    drops the oldest that are not under way (descriptions never). What was spooled is fsynced every `sync_interval_s`.

    At most `window_count` messages and `window_bytes` are under way, handed over up to `together_count` and
    `together_bytes` at a time. What is not acknowledged is sent again after `ack_timeout_s`, then after twice as long,
    up to `ack_timeout_max_s`. A session of the publisher's own is opened anew after `reopen_after_s` without
    acknowledgement.
    """

    root: str = DEFAULT_ROOT
    spool_limit_bytes: int = 1024 * MIB
    segment_bytes: int = 4 * MIB
    when_full: Literal["refuse", "drop oldest"] = "refuse"
    sync_interval_s: float = 0.005
    message_limit_bytes: int = 8 * MIB
    window_count: int = 8192
    window_bytes: int = 16 * MIB
    together_count: int = 256
    together_bytes: int = MIB
    ack_timeout_s: float = 1.0
    ack_timeout_max_s: float = 10.0
    reopen_after_s: float = 15.0

    def __post_init__(self) -> None:
        if self.segment_bytes * SEGMENTS_MIN > self.spool_limit_bytes:
            raise InputError(
                f"spool_limit_bytes {self.spool_limit_bytes}: at least {SEGMENTS_MIN} times segment_bytes, "
                f"{self.segment_bytes}"
            )
        for name in ("segment_bytes", "message_limit_bytes", "window_count", "window_bytes"):
            _require_positive(name, getattr(self, name))
        for name in ("together_count", "together_bytes", "sync_interval_s", "ack_timeout_s", "reopen_after_s"):
            _require_positive(name, getattr(self, name))
        if self.ack_timeout_max_s < self.ack_timeout_s:
            raise InputError(
                f"ack_timeout_max_s {self.ack_timeout_max_s:g}: at least ack_timeout_s, {self.ack_timeout_s:g}"
            )


def _require_positive(name: str, value: float) -> None:
    if not value > 0:
        raise InputError(f"{name} {value:g}: more than 0 is needed")

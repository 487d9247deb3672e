"""What ingest may be told."""

import os
import pwd
from dataclasses import dataclass, field

from trigpoint.configuration.limits import Count, Positive, Seconds
from trigpoint.events.keys import DEFAULT_MAP, DEFAULT_ROOT
from trigpoint_ingest.core.stamps import StampLimits


@dataclass(frozen=True, slots=True, kw_only=True)
class IngestSettings:
    """`fleet` names the only vehicles accepted, None accepts all that describe themselves. `vehicles` names those
    this process takes, where several share a fleet; without any it takes them all.

    Events of files are appended `batch_count` at a time, those that come live `live_batch_count` (of the vehicles that
    wait longest) or `batch_bytes`, or what there is after `batch_s` or once nothing more comes; while a group waits for
    the disk, `pending_count` more messages or `pending_bytes` of payload are taken, then none. A live message waits up
    to `gap_timeout_s` for an earlier one, with at most `held_limit` others of its drive. Of a refused payload
    `refused_payload_limit` bytes are kept.

    A payload has at most `message_limit_bytes`: the largest sweep of a lidar fits in. A vehicle may send
    `vehicle_rate_hz` messages a second, and `vehicle_burst` at once. At most `drive_limit` drives are known, and
    `name_limit` vehicles heard. A full disk is tried again every `disk_retry_s`; an append that takes longer than
    `slow_append_s` is told of.
    """

    root: str = DEFAULT_ROOT
    map_name: str = DEFAULT_MAP
    fleet: frozenset[str] | None = None
    vehicles: tuple[str, ...] = ()
    stamps: StampLimits = field(default_factory=StampLimits)
    batch_count: Count = 4096
    live_batch_count: Count = 256
    batch_bytes: Count = 4 * 1024 * 1024
    batch_s: float = 0.1
    pending_count: Count = 65_536
    pending_bytes: Count = 32 * 1024 * 1024
    gap_timeout_s: Seconds = 30.0
    held_limit: int = 16_384
    refused_payload_limit: int = 65_536
    message_limit_bytes: Count = 8 * 1024 * 1024
    vehicle_rate_hz: Positive = 50_000.0
    vehicle_burst: Count = 100_000
    drive_limit: Count = 100_000
    name_limit: Count = 10_000
    disk_retry_s: Seconds = 0.5
    slow_append_s: Seconds = 5.0
    claim_settle_s: float = 0.5


def operating_user() -> str:
    """The name of the user this process runs as: who makes corrections, unless somebody else is named."""
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return f"user {os.getuid()}"

"""What ingest may be told."""

import os
import pwd
from dataclasses import dataclass, field

from trigpoint.events.keys import DEFAULT_MAP, DEFAULT_ROOT
from trigpoint_ingest.core.stamps import StampLimits


@dataclass(frozen=True, slots=True, kw_only=True)
class IngestSettings:
    """`fleet` names the only vehicles accepted, None accepts all that describe themselves.

    Events are appended `batch_count` at a time, or after `batch_s` for those that come live. A live message
    waits up to `gap_timeout_s` for an earlier one, with at most `held_limit` others of its drive. Of a refused
    payload `refused_payload_limit` bytes are kept.
    """

    root: str = DEFAULT_ROOT
    map_name: str = DEFAULT_MAP
    fleet: frozenset[str] | None = None
    stamps: StampLimits = field(default_factory=StampLimits)
    batch_count: int = 4096
    batch_s: float = 0.1
    gap_timeout_s: float = 30.0
    held_limit: int = 16_384
    refused_payload_limit: int = 65_536


def operating_user() -> str:
    """The name of the user this process runs as: who makes corrections, unless somebody else is named."""
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return f"user {os.getuid()}"

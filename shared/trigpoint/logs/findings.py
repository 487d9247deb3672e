"""What verification says of a log file: what it holds, and what is wrong with it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Finding:
    """Something wrong with a file. `kind` is one of "damaged", "unfinished" (its writer died),
    "number gap", "repeated identity", "unknown channel", "broken seal", "missing file", "wrong catalog";
    `lost_messages` -1 where it cannot be told."""

    path: Path
    offset: int
    kind: str
    detail: str
    lost_messages: int = 0


@dataclass(frozen=True, slots=True)
class TopicSummary:
    """The messages of one topic in a file, and the times [start, end] they span."""

    topic: str
    schema_name: str
    count: int
    start_ns: int
    end_ns: int


@dataclass(frozen=True, slots=True)
class FileSummary:
    """What the whole part of a file holds. Times [start, end] are 0 for an empty one."""

    path: Path
    stream: str
    size_bytes: int
    count: int
    start_ns: int
    end_ns: int
    vehicles: tuple[str, ...]
    topics: tuple[TopicSummary, ...]
    metadata: Mapping[str, Mapping[str, str]]

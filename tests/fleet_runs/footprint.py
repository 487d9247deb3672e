"""What running processes hold: resident memory and file handles over time, and whether they are flat.

Memory shared between processes is left out: Zenoh maps a pool of fixed size for each session on the same machine once
that sends its first message of over 3 kB, which comes sooner or later.
"""

import os
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median

OWN = ("RssAnon:", "RssFile:")  # lines of /proc/PID/status, in KiB
PARTS = 5  # of a window: the first is held against the last
KIB, MIB = 1 << 10, 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Footprint:
    """What a process held, seconds after the watch began."""

    at_s: float
    resident_bytes: int
    handles: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Growth:
    """How much more a process held in the last fifth of a window than in its first, by medians."""

    resident_bytes: float
    resident_share: float
    handles: float


def footprint_of(pid: int, *, at_s: float) -> Footprint:
    """What a process holds now. Raises FileNotFoundError once it is gone."""
    lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    resident_kib = sum(int(line.split()[1]) for line in lines if line.startswith(OWN))
    handles = len(os.listdir(f"/proc/{pid}/fd"))
    return Footprint(at_s=at_s, resident_bytes=resident_kib * KIB, handles=handles)


def growth(footprints: Sequence[Footprint]) -> Growth:
    """The growth over a window of at least as many footprints as it has parts."""
    size = len(footprints) // PARTS
    first, last = footprints[:size], footprints[-size:]
    before = median(one.resident_bytes for one in first)
    grown = median(one.resident_bytes for one in last) - before
    handles = median(one.handles for one in last) - median(one.handles for one in first)
    return Growth(resident_bytes=grown, resident_share=grown / before, handles=handles)


def last_share(footprints: Sequence[Footprint], share: float) -> Sequence[Footprint]:
    """The footprints of the last part of the time."""
    from_s = footprints[-1].at_s * (1.0 - share)
    return [one for one in footprints if one.at_s >= from_s]


@contextmanager
def watched(pids: Mapping[str, int], *, interval_s: float) -> Iterator[Mapping[str, list[Footprint]]]:
    """What each process holds, again and again while it is open."""
    found: dict[str, list[Footprint]] = {name: [] for name in pids}
    began_s, stop = time.monotonic(), threading.Event()

    def watch() -> None:
        while not stop.wait(interval_s):
            for name, pid in pids.items():
                found[name].append(footprint_of(pid, at_s=time.monotonic() - began_s))

    thread = threading.Thread(target=watch, name="watch", daemon=True)
    thread.start()
    try:
        yield found
    finally:
        stop.set()
        thread.join()

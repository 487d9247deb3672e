"""A log of known events, one bit of it flipped or one of its files cut, and what is left of it held against it."""

import shutil
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from random import Random

from event_examples.rows import STEP_NS, imu_row
from trigpoint.errors import TrigpointError
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.stream_writer import Rotation

VEHICLES = ("car", "van")
BATCH_EVENTS, FILE_EVENTS = 20, 200
Expected = dict[str, list[Envelope[Event]]]


def written_log(directory: Path, *, events: int) -> Expected:
    """The events of each stream of a closed log: several files a stream, several chunks a file."""
    expected: Expected = {}
    rotation = Rotation(span_ns=(FILE_EVENTS - 1) * STEP_NS, span_least_bytes=0)
    with closing(McapLog(directory, rotation=rotation)) as log:
        for vehicle in VEHICLES:
            rows = expected[f"veh-{vehicle}"] = [imu_row(number, vehicle=vehicle) for number in range(events)]
            for first in range(0, events, BATCH_EVENTS):
                log.append(f"veh-{vehicle}", rows[first : first + BATCH_EVENTS])
    return expected


@dataclass(frozen=True, slots=True)
class Damage:
    """What was done to which file; `at` is the byte flipped, or the length it was cut to."""

    path: Path
    kind: str
    at: int


def damaged_copy(source: Path, copy: Path, *, kind: str, seed: int, suffixes: Sequence[str] = (".mcap",)) -> Damage:
    """A copy of a log with one random bit flipped ("flip") or one random file cut ("cut")."""
    random = Random(f"{kind}-{seed}")
    shutil.copytree(source, copy)
    files = [path for path in sorted(copy.rglob("*")) if path.is_file() and path.name.endswith(tuple(suffixes))]
    path = random.choices(files, weights=[file.stat().st_size for file in files])[0]
    content = bytearray(path.read_bytes())
    at = random.randrange(len(content))
    if kind == "flip":
        content[at] ^= 1 << random.randrange(8)
    else:
        del content[at:]
    path.write_bytes(content)
    return Damage(path, kind, at)


@dataclass(frozen=True, slots=True)
class Remains:
    """How many events of a log are read, and how many of them are not what stood at their number."""

    count: int
    wrong: int


def remains(directory: Path, expected: Expected) -> Remains:
    """What a log, damaged or recovered, still gives of the events it once held."""
    count = wrong = 0
    with closing(McapLog(directory)) as log:
        for stream, rows in expected.items():
            try:
                for row in log.read(stream):
                    count += 1
                    wrong += row.envelope != rows[row.position.number]
            except TrigpointError:  # everything before the damage was read
                continue
    return Remains(count, wrong)

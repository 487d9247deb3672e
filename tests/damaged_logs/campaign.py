"""Many damages to one log, each of them found, recovered from and held against what was written."""

import json
import shutil
import subprocess
from collections.abc import Iterable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from command_runs.running import trigpoint
from damaged_logs.damaging import Damage, Expected, damaged_copy, remains, written_log
from trigpoint.logs.log_files import entry_of
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.seals import seal_finished

EVENTS = 400  # of each stream
REAL_EVERY = 50  # one case in so many through processes of their own, the others call the command in this one


@dataclass(frozen=True, slots=True)
class Case:
    """What came of one damage. `unread`: events outside the damaged chunks that recovery did not bring back, `wrong`
    those it brought back as something else."""

    damage: Damage
    found: bool
    recovered: bool
    unread: int
    wrong: int


@dataclass(frozen=True, slots=True)
class SealedLog:
    """A log of known events, sealed, to be copied and damaged."""

    directory: Path
    expected: Expected

    @property
    def count(self) -> int:
        """How many events it holds."""
        return sum(map(len, self.expected.values()))

    def spared(self, damage: Damage) -> int:
        """How many events stand in chunks that a damage did not touch."""
        path = damage.path
        if path.suffix != ".mcap":
            return self.count
        entry = entry_of(self.directory / path.parent.name, path.parent.name, int(path.stem))
        flipped = (chunk for chunk in entry.chunks if chunk.offset <= damage.at < chunk.offset + chunk.length)
        cut = (chunk for chunk in entry.chunks if chunk.offset + chunk.length > damage.at)
        return self.count - sum(chunk.count for chunk in (flipped if damage.kind == "flip" else cut))


def sealed_log(directory: Path) -> SealedLog:
    """The log, written and sealed."""
    expected = written_log(directory, events=EVENTS)
    with closing(McapLog(directory)) as log:
        for stream in log.streams():
            seal_finished(directory / stream)
    return SealedLog(directory, expected)


def cases(log: SealedLog, folder: Path, *, kind: str, seeds: Iterable[int], program: tuple[str, ...]) -> list[Case]:
    """One damage a seed: of three logs one keeps catalog and seals, one its seals only, one neither."""
    return [_case(log, folder, kind, seed, program if seed % REAL_EVERY == 0 else ()) for seed in seeds]


def _case(log: SealedLog, folder: Path, kind: str, seed: int, program: tuple[str, ...]) -> Case:
    copy, out = folder / "damaged", folder / "recovered"
    for path in (copy, out):
        shutil.rmtree(path, ignore_errors=True)
    damage = damaged_copy(_stripped(log.directory, folder, seed % 3), copy, kind=kind, seed=seed)
    found = _said(program, "log", "verify", copy)
    recovered = _said(program, "log", "recover", copy, out)
    again = _said(program, "log", "verify", out)
    left = remains(out, log.expected)
    return Case(
        damage=damage,
        found=found[0] == 2 and bool(found[1]["findings"]),
        recovered=recovered[0] == again[0] == 0 and recovered[1]["count"] == again[1]["count"] == left.count,
        unread=max(log.spared(damage) - left.count, 0),
        wrong=left.wrong,
    )


def _stripped(directory: Path, folder: Path, less: int) -> Path:
    """The log without its catalog (1), or without its seals either (2)."""
    target = folder / f"stripped-{less}"
    if not target.exists():
        shutil.copytree(directory, target)
        if less:
            (target / "catalog.sqlite").unlink()
        for seal in target.rglob("*.sha256") if less == 2 else ():
            seal.unlink()
    return target


def _said(program: tuple[str, ...], *words: str | Path) -> tuple[int, Any]:
    """Status and answer of a command: in a process of its own if `program` is given."""
    if not program:
        run = trigpoint(*words, "--json")
        return run.status, run.answer
    finished = subprocess.run([*program, *map(str, words), "--json"], capture_output=True, text=True, check=False)
    return finished.returncode, json.loads(finished.stdout)

"""Decoders under coverage-guided fuzzing, each in a process of its own: a crash takes the process with it."""

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from fuzzed_decoders.targets import fast_folder

TESTS = Path(__file__).parents[1]
TIMEOUT_S = 1800.0
EXECUTED = re.compile(r"number_of_executed_units: (\d+)")


@dataclass(frozen=True, slots=True)
class GuidedRun:
    """How many inputs the decoders got, and what ended them before their time; empty if nothing did."""

    inputs: int
    crash: str


def guided(decoder: str, *, runs: int, seed: int) -> GuidedRun:
    """A decoder by name, or "all", through so many inputs."""
    words = ("--decoder", decoder, "--runs", str(runs), "--seed", str(seed))
    with fast_folder() as folder:
        ended = subprocess.run(
            [sys.executable, "-m", "fuzzed_decoders.guided", "--folder", folder, *words],
            cwd=TESTS,
            env=os.environ | {"PYTHONPATH": os.pathsep.join((str(TESTS), os.environ.get("PYTHONPATH", "")))},
            capture_output=True,
            timeout=TIMEOUT_S,
            check=False,
        )
    said = ended.stderr.decode("utf-8", "replace")
    executed = EXECUTED.search(said)
    crash = "" if ended.returncode == 0 else f"{decoder}: status {ended.returncode}: {said[-2000:]}"
    return GuidedRun(int(executed.group(1)) if executed else 0, crash)

"""Every decoder under fuzzing, led by coverage and by properties, and valid events among malformed ones."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from figures.figure import Bounds, Figure, Measurement, at_least, at_most
from figures.workbench import CommandFailed, Workbench

INPUTS = 200_000
WORDS = ("-m", "fuzzed_decoders", "--inputs", str(INPUTS))
TESTS = Path(__file__).parents[1]


@cache
def _fuzzed() -> dict[str, Any]:
    """What the fuzzing said; run once. Raises CommandFailed where it said nothing."""
    environment = os.environ | {"PYTHONPATH": str(TESTS)}
    ended = subprocess.run([sys.executable, *WORDS], cwd=TESTS, env=environment, capture_output=True, check=False)
    try:
        answer: dict[str, Any] = json.loads(ended.stdout)
    except ValueError as error:
        said = ended.stderr.decode("utf-8", "replace")[-500:]
        raise CommandFailed(f"python {' '.join(WORDS)}: status {ended.returncode}: {said}") from error
    return answer


def _of(*path: str) -> Callable[[Workbench], Measurement]:
    def measure(bench: Workbench) -> Measurement:
        value: Any = _fuzzed()
        for step in path:
            value = value[step]
        return Measurement(value=float(value), command=f"python {' '.join(WORDS)}")

    return measure


def _figure(name: str, target: Bounds | None, *path: str) -> Figure:
    return Figure(name=name, unit="1", target=target, measure=_of(*path))


FIGURES = (
    _figure("malformed inputs to every decoder", at_least(INPUTS), "inputs"),
    _figure("crashes of a decoder", at_most(0.0), "crashes"),
    _figure("valid events sent among malformed ones", None, "stream", "valid"),
    _figure("valid events lost", at_most(0.0), "stream", "lost"),
    _figure("malformed messages taken for events", at_most(0.0), "stream", "malformed_kept"),
)

"""What a command says and how it ends."""

import contextlib
import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from trigpoint_cli.app import run


@dataclass(frozen=True, slots=True)
class Run:
    """One command's exit status and what it wrote."""

    status: int
    out: str
    err: str

    @property
    def answer(self) -> Any:
        """The one JSON object on standard output; anything else there fails."""
        return json.loads(self.out)


def trigpoint(*words: str | int | float | Path) -> Run:
    """The command with these words, in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = run([str(word) for word in words])
    return Run(status, out.getvalue(), err.getvalue())

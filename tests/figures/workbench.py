"""Runs `trigpoint` commands in a temporary folder, each at most once in a run, and keeps what they said."""

import json
import shlex
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

FOLDER_NAME = "$WORK"  # what stands for the temporary folder in a command that is shown


class CommandFailed(Exception):
    """A command ended with another status than 0, or said no JSON where it should."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a command said: `answer` its JSON (None without `--json`), `wall_s` its duration, start-up included."""

    command: str
    answer: Any
    wall_s: float

    def at(self, path: str) -> float:
        """The number at a dotted path of the answer, as in "error_m.median". Raises CommandFailed if there is none."""
        node = self.answer
        for step in path.split("."):
            if not isinstance(node, dict) or step not in node:
                raise CommandFailed(f"{self.command}: no {path!r} in its JSON")
            node = node[step]
        if isinstance(node, bool) or not isinstance(node, int | float):
            raise CommandFailed(f"{self.command}: {path!r} is {node!r}, not a number")
        return float(node)


@dataclass(frozen=True, slots=True)
class Workbench:
    """A temporary folder, the recorded drives, and the commands that were run there."""

    folder: Path
    drives: Path
    program: tuple[str, ...]
    done: dict[tuple[str, ...], Outcome | CommandFailed] = field(default_factory=dict)

    def path(self, name: str) -> str:
        """A path in the temporary folder."""
        return str(self.folder / name)

    def drive(self, name: str) -> str:
        """A folder of recorded drives. Raises CommandFailed where it is absent."""
        if not (self.drives / name).exists():
            raise CommandFailed(f"recorded drive {name!r} is not at {self.drives}")
        return str((self.drives / name).resolve())

    def run(self, *words: str | int | float) -> Outcome:
        """The outcome of `trigpoint` with these words; the same words are run once, failed or not.

        Raises CommandFailed.
        """
        arguments = tuple(str(word) for word in words)
        if arguments not in self.done:
            try:
                self.done[arguments] = self._outcome(arguments)
            except CommandFailed as error:
                self.done[arguments] = error
        outcome = self.done[arguments]
        if isinstance(outcome, CommandFailed):
            raise outcome
        return outcome

    def _outcome(self, arguments: tuple[str, ...]) -> Outcome:
        shown = shlex.join(("trigpoint", *arguments)).replace(str(self.folder), FOLDER_NAME)
        began_s = time.perf_counter()
        finished = subprocess.run([*self.program, *arguments], capture_output=True, text=True, check=False)
        wall_s = time.perf_counter() - began_s
        if finished.returncode != 0:
            last = (finished.stderr.strip().splitlines() or ["it said nothing"])[-1]
            raise CommandFailed(f"{shown}: exit status {finished.returncode}: {last}")
        return Outcome(
            command=shown, answer=_json_of(shown, finished.stdout) if "--json" in arguments else None, wall_s=wall_s
        )


def _json_of(command: str, text: str) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise CommandFailed(f"{command}: its output is not JSON: {error}") from error

"""The processes of a machine's services: started, watched and ended by the one that supervises them."""

import http.client
import json
import logging
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from trigpoint.configuration.sections import HttpSettings

PROBE_S = 1.0  # how long a child may take to say whether it is ready
ANY_ADDRESS = {"0.0.0.0": "127.0.0.1", "::": "::1"}

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChildCommand:
    """How a process is started: with the configuration its supervisor has."""

    config: Path | None
    flags: tuple[str, ...]

    def words(self, process: str) -> list[str]:
        """The command line of a process that ends with this one."""
        command = ["router"] if process == "router" else ["serve", process]
        file = [] if self.config is None else ["--config", str(self.config)]
        flags = [word for flag in self.flags for word in ("--set", flag)]
        return [sys.executable, "-m", "trigpoint_cli", *command, *file, *flags, "--until-input-ends"]


class Child:
    """One running process. Its standard input is a pipe from here: it ends when this process does, however that
    happens, and stops then. In a process group of its own, it hears nothing of a terminal's Ctrl-C.
    """

    def __init__(self, words: Sequence[str]) -> None:
        self._process = subprocess.Popen(list(words), stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, process_group=0)

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def status(self) -> int | None:
        """Its exit status (negative: the signal that ended it), or None while it runs."""
        status = self._process.poll()
        if status is not None:
            self._close_input()
        return status

    def stop(self, limit_s: float) -> bool:
        """Whether it ended within the limit after being asked to; if not, it was killed."""
        self._process.terminate()
        try:
            self._process.wait(limit_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            return False
        finally:
            self._close_input()
        return True

    def _close_input(self) -> None:
        if self._process.stdin is not None:
            self._process.stdin.close()


def is_ready(process: str, settings: HttpSettings) -> bool:
    """Whether a process says that it is ready; one that cannot be asked is taken to be."""
    port = settings.ports()[process]
    if not settings.enabled or port == 0:
        return True
    connection = http.client.HTTPConnection(ANY_ADDRESS.get(settings.host, settings.host), port, timeout=PROBE_S)
    try:
        connection.request("GET", "/readyz")
        answer = connection.getresponse()
        return answer.status == http.client.OK and json.loads(answer.read()).get("service") == process
    except (OSError, http.client.HTTPException, ValueError):
        return False
    finally:
        connection.close()

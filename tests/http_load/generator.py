"""Requests as fast as they are answered, by wrk: a generator light enough to leave the processors to the servers."""

import json
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

CONNECTIONS = 8
SCRIPT = """
local file = io.open("{paths}", "r")
local paths = {{}}
for line in file:lines() do paths[#paths + 1] = line end
file:close()
local at = 0
request = function()
  at = at % #paths + 1
  return wrk.format("GET", paths[at])
end
done = function(summary, latency, requests)
  io.write(string.format('{{"rate_hz": %.3f, "refused": %d, "errors": %d, "bytes": %.1f, "p99_ms": %.3f}}\\n',
    summary.requests / (summary.duration / 1e6), summary.errors.status,
    summary.errors.connect + summary.errors.read + summary.errors.write + summary.errors.timeout,
    summary.bytes / math.max(1, summary.requests), latency:percentile(99.0) / 1000))
end
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """What came of a load: answers a second, their size with headers, and the slowest hundredth."""

    rate_hz: float
    bytes_each: float
    p99_ms: float


def loaded(url: str, paths: list[str], folder: Path, *, seconds: int) -> Load:
    """The paths asked for in turn, over and over. Raises OSError without wrk, and for any answer that is no success."""
    program = shutil.which("wrk")
    if program is None:
        raise OSError("wrk is not installed (Debian: wrk)")
    listed, script = folder / "paths.txt", folder / "paths.lua"
    listed.write_text("\n".join(paths) + "\n", encoding="utf-8")
    script.write_text(SCRIPT.format(paths=listed), encoding="utf-8")
    command = [program, "-t1", f"-c{CONNECTIONS}", f"-d{seconds}", "--timeout", "10s", "-s", str(script), url]
    said = subprocess.run(command, capture_output=True, text=True, check=True, timeout=seconds + 60.0).stdout
    told = json.loads(said.strip().splitlines()[-1])
    if told["refused"] or told["errors"]:
        raise OSError(f"{url}{paths[0]}: {told['refused']} answers refused, {told['errors']} failed")
    return Load(rate_hz=told["rate_hz"], bytes_each=told["bytes"], p99_ms=told["p99_ms"])

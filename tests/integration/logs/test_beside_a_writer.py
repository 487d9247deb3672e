"""A log read, sealed and shortened while another process writes it."""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from event_examples.rows import STEP_NS
from trigpoint.logs.following import StreamFollower
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.retention import Keeping, log_files, obstacles, planned_retention, remove_files
from trigpoint.logs.seals import seal_finished
from trigpoint.logs.verification import verify

STREAM = "veh-van"
EVENTS, BATCH = 3000, 10
LIMIT_S = 120.0
WRITES = f"""
import sys
from pathlib import Path
from event_examples.rows import imu_rows
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.stream_writer import Rotation
log = McapLog(Path(sys.argv[1]), rotation=Rotation(span_ns={99 * STEP_NS}, span_least_bytes=0))
for first in range(0, {EVENTS}, {BATCH}):
    log.append("{STREAM}", imu_rows(first, first + {BATCH}))
log.close()
"""
FSYNC_S = 3.0
SYNCS_SLOWLY = f"""
import os, sys, time
from pathlib import Path
from event_examples.rows import imu_rows
from trigpoint.logs.mcap_log import McapLog
log = McapLog(Path(sys.argv[1]))
log.append("{STREAM}", imu_rows(0, 10))
fsync = os.fsync
def slow(descriptor):
    print("syncing", flush=True)
    time.sleep({FSYNC_S})
    fsync(descriptor)
os.fsync = slow
log.append("{STREAM}", imu_rows(10, 20))
os.fsync = fsync
print("acknowledged", flush=True)
sys.stdin.read()
log.close()
"""


@contextmanager
def _writer(script: str, directory: Path) -> Iterator["subprocess.Popen[str]"]:
    command = [sys.executable, "-c", script, str(directory)]
    environment = {"PYTHONPATH": ":".join(path for path in sys.path if path)}
    with subprocess.Popen(
        command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def _followed(log: McapLog) -> list[int]:
    """The numbers taken while another process wrote and this one sealed and shortened, until all were."""
    follower, ends_s = StreamFollower(log, [STREAM]), time.monotonic() + LIMIT_S
    numbers: list[int] = []
    while len(numbers) < EVENTS and time.monotonic() < ends_s:
        numbers += [row.position.number for row in follower.take(200)]
        if (log.directory / STREAM).is_dir():
            seal_finished(log.directory / STREAM)
            held = obstacles(log, {"follower": follower.checkpoint}, also_inputs=False)
            remove_files(log.directory, planned_retention(log_files(log), held, Keeping(total_bytes=20_000)).removed)
    return numbers


def test_every_event_is_followed_once_in_order_while_files_are_begun_sealed_and_taken_away(tmp_path: Path) -> None:
    with _writer(WRITES, tmp_path) as process, closing(McapLog(tmp_path)) as log:
        assert _followed(log) == list(range(EVENTS))
        assert process.wait(LIMIT_S) == 0
        assert log.begins_at(STREAM) > 0
    assert verify(tmp_path).findings == ()


def test_a_slow_disk_keeps_no_reader_waiting_and_shows_nothing_that_is_not_durable(tmp_path: Path) -> None:
    with _writer(SYNCS_SLOWLY, tmp_path) as process, closing(McapLog(tmp_path)) as log:
        assert process.stdout is not None
        assert process.stdout.readline() == "syncing\n"
        began_s = time.monotonic()
        assert (log.next_number(STREAM), sum(1 for _ in log.read(STREAM))) == (10, 10)
        assert time.monotonic() - began_s < FSYNC_S / 2.0
        assert process.stdout.readline() == "acknowledged\n"
        assert (log.next_number(STREAM), sum(1 for _ in log.read(STREAM))) == (20, 20)

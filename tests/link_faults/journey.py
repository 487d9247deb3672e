"""A vehicle's way to the log through faults, and what became of its messages."""

import os
import random
import signal
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from command_runs.processes import CLEAN, Fleet, Process, fleet_in, trigpoint_process, wait_until
from link_faults.proxy import CuttableLink, cuttable_link
from trigpoint.logs.mcap_log import McapLog

VEHICLE = "veh-a"
TESTS = Path(__file__).resolve().parents[1]
PATIENCE_S = 180.0  # for what was held back to be acknowledged, on a machine with other work

Identity = tuple[str, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Of what the publisher `taken` said it took: `lost` is not in the log, `twice` is more than once, and
    `disordered` stands behind a higher number of its boot.
    """

    taken: int
    lost: int
    twice: int
    disordered: int


@dataclass(frozen=True, slots=True)
class Journey:
    """A fleet with a router and ingest, and a link to it."""

    fleet: Fleet
    router: Process
    ingest: Process
    link: CuttableLink

    @property
    def taken_path(self) -> Path:
        """Where the vehicle writes down what its publisher took."""
        return self.fleet.folder / "taken"

    @property
    def spool(self) -> Path:
        """The vehicle's spool."""
        return self.fleet.folder / "spool"

    def taken(self) -> list[Identity]:
        """What the publisher took so far."""
        if not self.taken_path.exists():
            return []
        lines = self.taken_path.read_text(encoding="ascii").splitlines()
        return [(boot_id, int(number)) for boot_id, number in map(str.split, lines)]

    def wait_for_taken(self, more: int) -> None:
        """Returns once the publisher took so many more."""
        enough = len(self.taken()) + more
        wait_until(lambda: len(self.taken()) >= enough, f"{enough} messages taken")

    @contextmanager
    def vehicle(self, rate_hz: float) -> Iterator["subprocess.Popen[bytes]"]:
        """The vehicle's program, killed at the end if it still runs."""
        words = ("--vehicle", VEHICLE, "--spool", self.spool, "--connect", self.link.endpoint)
        said = ("--rate-hz", rate_hz, "--taken", self.taken_path)
        environment = {**CLEAN, "PYTHONPATH": str(TESTS)}
        with (self.fleet.folder / "vehicle.err").open("ab") as err:
            command = [sys.executable, "-m", "link_faults.vehicle", *map(str, (*words, *said))]
            process = subprocess.Popen(command, stderr=err, env=environment)
            try:
                yield process
            finally:
                process.kill()
                process.wait()

    def outcome(self) -> Outcome:
        """What became of the messages so far."""
        taken = set(self.taken())
        log = McapLog(self.fleet.data / "log")
        try:
            logged = [
                (row.envelope.identity.boot_id, row.envelope.identity.sequence) for row in log.read(f"veh-{VEHICLE}")
            ]
        finally:
            log.close()
        return Outcome(
            taken=len(taken),
            lost=len(taken - set(logged)),
            twice=sum(count - 1 for count in Counter(logged).values()),
            disordered=disordered(logged),
        )


@contextmanager
def journey_in(folder: Path) -> Iterator[Journey]:
    """A running fleet of a router and ingest, and the link."""
    folder.mkdir(parents=True, exist_ok=True)
    fleet = fleet_in(folder)
    port = int(fleet.endpoint.rpartition(":")[2])
    with (
        trigpoint_process(folder, "router", "--config", fleet.config) as router,
        trigpoint_process(folder, "serve", "ingest", "--config", fleet.config) as ingest,
        cuttable_link(port) as link,
    ):
        fleet.wait_ready("ingest")
        yield Journey(fleet, router, ingest, link)


def disordered(logged: Sequence[Identity]) -> int:
    """How many stand behind a higher number of their boot."""
    highest: dict[str, int] = {}
    behind = 0
    for boot_id, number in logged:
        behind += number < highest.get(boot_id, -1)
        highest[boot_id] = max(number, highest.get(boot_id, -1))
    return behind


def through_cuts(journey: Journey, *, cuts: int, cut_s: float, rate_hz: float) -> Outcome:
    """The link cut again and again, silently and closed in turns, while the vehicle goes on sending."""
    pause = threading.Event()
    with journey.vehicle(rate_hz) as vehicle:
        for number in range(cuts):
            journey.wait_for_taken(max(round(rate_hz), 1))
            journey.link.cut(closing=number % 2 == 1)
            pause.wait(cut_s)
            journey.link.mend()
        ended_well(vehicle)
    return journey.outcome()


def through_a_stop(journey: Journey, *, stop_s: float, rate_hz: float) -> Outcome:
    """Ingest stopped for so long, which Zenoh bears for 5 s, and the vehicle's program for all of it but a second."""
    pause = threading.Event()
    with journey.vehicle(rate_hz) as vehicle:
        journey.wait_for_taken(max(round(rate_hz), 1))
        journey.ingest.send(signal.SIGSTOP)
        pause.wait(1.0)
        vehicle.send_signal(signal.SIGSTOP)
        pause.wait(stop_s - 1.0)
        journey.ingest.send(signal.SIGCONT)
        vehicle.send_signal(signal.SIGCONT)
        journey.wait_for_taken(1)
        ended_well(vehicle)
    return journey.outcome()


def through_kills(journey: Journey, *, kills: int, rate_hz: float, seed: int) -> Outcome:
    """The vehicle's program killed at random moments and started anew on its spool; the last one ends in order."""
    die, pause = random.Random(seed), threading.Event()
    for _ in range(kills):
        with journey.vehicle(rate_hz) as vehicle:
            journey.wait_for_taken(die.randint(1, max(round(rate_hz / 2), 2)))
            pause.wait(die.uniform(0.0, 0.1))
            vehicle.kill()
    with journey.vehicle(rate_hz) as vehicle:
        journey.wait_for_taken(1)
        ended_well(vehicle)
    return journey.outcome()


def ended_well(vehicle: "subprocess.Popen[bytes]") -> None:
    """The vehicle's program ends with everything acknowledged."""
    os.kill(vehicle.pid, signal.SIGTERM)
    assert vehicle.wait(PATIENCE_S) == 0, "the vehicle's messages were not all acknowledged"

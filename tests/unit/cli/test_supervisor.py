"""A machine's processes kept running, on a machine and a clock of the test's own."""

from dataclasses import dataclass, field

from trigpoint.configuration.sections import UpSettings
from trigpoint.observability.metrics import Instruments
from trigpoint_cli.supervisor import Machine, Supervisor

SETTINGS = UpSettings(
    services=("router", "ingest"), backoff_first_s=1.0, failing_count=2, start_limit_s=5.0, stop_limit_s=3.0
)


@dataclass
class Process:
    """A process that ends when it is told to."""

    pid: int
    ended: int | None = None
    stoppable: bool = True
    stopped_within_s: float | None = None

    def status(self) -> int | None:
        return self.ended

    def stop(self, limit_s: float) -> bool:
        self.stopped_within_s = limit_s
        return self.stoppable


@dataclass
class Told:
    """Requests to stop: one, after as many looks."""

    looks: int

    def wait(self, timeout_s: float) -> str | None:
        self.looks -= 1
        return "SIGTERM" if self.looks < 0 else None


@dataclass
class Bench:
    """What was started, who is ready, and the time."""

    now_s: float = 0.0
    ready: set[str] = field(default_factory=set)
    started: list[str] = field(default_factory=list)
    running: dict[str, Process] = field(default_factory=dict)
    instruments: Instruments = field(default_factory=lambda: Instruments("up"))

    def supervisor(self) -> Supervisor:
        machine = Machine(start=self.start, is_ready=lambda name: name in self.ready)
        return Supervisor(SETTINGS, machine, self.instruments, now_s=lambda: self.now_s)

    def start(self, name: str) -> Process:
        self.started.append(name)
        self.running[name] = Process(pid=len(self.started))
        return self.running[name]


def both_up() -> tuple[Bench, Supervisor]:
    bench = Bench(ready={"router", "ingest"})
    supervisor = bench.supervisor()
    supervisor.look()
    return bench, supervisor


def test_the_next_one_starts_once_the_one_before_is_ready() -> None:
    bench = Bench()
    supervisor = bench.supervisor()
    supervisor.look()
    assert bench.started == ["router"]
    bench.ready.add("router")
    supervisor.look()
    assert bench.started == ["router", "ingest"]


def test_one_that_is_never_ready_holds_the_next_back_for_a_limited_time() -> None:
    bench = Bench()
    supervisor = bench.supervisor()
    supervisor.look()
    bench.now_s = 4.9
    supervisor.look()
    assert bench.started == ["router"]
    bench.now_s = 5.0
    supervisor.look()
    assert bench.started == ["router", "ingest"]


def test_one_that_ended_starts_again_after_its_wait_and_is_counted() -> None:
    bench, supervisor = both_up()
    bench.running["ingest"].ended = -9
    supervisor.look()
    assert bench.started == ["router", "ingest"]
    bench.now_s = 1.0
    supervisor.look()
    assert bench.started == ["router", "ingest", "ingest"]
    assert b'trigpoint_restarts_total{name="ingest"} 1.0' in supervisor.exposition()


def test_one_that_keeps_ending_makes_the_machine_unwell_and_the_others_go_on() -> None:
    bench, supervisor = both_up()
    bench.running["router"].ended = 1
    supervisor.look()
    assert supervisor.alive()[0]
    bench.now_s = 1.0
    supervisor.look()
    bench.running["router"].ended = 1
    supervisor.look()
    well, told = supervisor.alive()
    assert (well, told["failing"]) == (False, ["router"])
    assert bench.running["ingest"].stopped_within_s is None


def test_the_machine_is_ready_when_every_process_runs_and_is() -> None:
    bench, supervisor = both_up()
    assert supervisor.ready()[0]
    bench.running["ingest"].ended = 0
    supervisor.look()
    assert supervisor.ready() == (False, {"waiting_for": ["ingest"]})


def test_all_are_stopped_in_reverse_within_the_limit_and_one_that_had_to_be_killed_is_named() -> None:
    bench, supervisor = both_up()
    bench.running["router"].stoppable = False
    assert supervisor.run(Told(looks=1)) == "SIGTERM"
    assert [process.stopped_within_s for process in bench.running.values()] == [3.0, 3.0]
    assert supervisor.killed == ["router"]

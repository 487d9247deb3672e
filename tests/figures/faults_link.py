"""A vehicle's link cut, its ends stopped, its program killed: what becomes of its messages; and what a spool costs."""

from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path

from figures.figure import Bounds, Figure, Measurement, at_least, at_most
from figures.workbench import CommandFailed, Workbench
from link_faults.journey import Journey, Outcome, journey_in, through_a_stop, through_cuts, through_kills
from link_faults.rates import Rates, rates_of

Course = Callable[[Journey], Outcome]

CUTS, CUT_S, STOP_S, KILLS, SEED = 10, 60.0, 30.0, 100, 1
RATE_HZ = 100.0  # as an IMU sends
BACKLOG_HZ = 2000.0  # so that the stalled transport fills up before its close
MESSAGES, SIZE_BYTES = 100_000, 256


def cut(journey: Journey) -> Outcome:
    """Ten cuts of a minute."""
    return through_cuts(journey, cuts=CUTS, cut_s=CUT_S, rate_hz=RATE_HZ)


def stopped(journey: Journey) -> Outcome:
    """Both ends stopped for half a minute."""
    return through_a_stop(journey, stop_s=STOP_S, rate_hz=BACKLOG_HZ)


def killed(journey: Journey) -> Outcome:
    """The program killed a hundred times."""
    return through_kills(journey, kills=KILLS, rate_hz=RATE_HZ, seed=SEED)


COMMANDS: Mapping[Course, str] = {
    cut: f"link_faults.journey.through_cuts(cuts={CUTS}, cut_s={CUT_S:g}, rate_hz={RATE_HZ:g})",
    stopped: f"link_faults.journey.through_a_stop(stop_s={STOP_S:g}, rate_hz={BACKLOG_HZ:g})",
    killed: f"link_faults.journey.through_kills(kills={KILLS}, rate_hz={RATE_HZ:g}, seed={SEED})",
}
RATES_COMMAND = f"link_faults.rates.rates_of(messages={MESSAGES}, size_bytes={SIZE_BYTES})"


@cache
def outcome_of(course: Course, folder: Path) -> Outcome:
    """What became of the messages of one course of faults; each is run once in a folder."""
    with journey_in(folder / f"link-{course.__name__}") as journey:
        return course(journey)


@cache
def measured_rates(folder: Path) -> Rates:
    """The rates of one run."""
    return rates_of(folder / "rates", messages=MESSAGES, size_bytes=SIZE_BYTES)


def faults(bench: Workbench, *, course: Course, count: Callable[[Outcome], float]) -> Measurement:
    """A number of a course's outcome."""
    try:
        return Measurement(value=count(outcome_of(course, bench.folder)), command=COMMANDS[course])
    except AssertionError as error:
        raise CommandFailed(f"{COMMANDS[course]}: {error}") from error


def of_rates(bench: Workbench, *, value: Callable[[Rates], float]) -> Measurement:
    """A number of the rates."""
    return Measurement(value=value(measured_rates(bench.folder)), command=RATES_COMMAND)


def figures_of(course: Course, what: str) -> tuple[Figure, ...]:
    """What was taken, and that it is in the log once and in order."""
    counts: tuple[tuple[str, Callable[[Outcome], float], Bounds | None], ...] = (
        ("messages taken", lambda outcome: outcome.taken, at_least(1.0)),
        ("lost", lambda outcome: outcome.lost, at_most(0.0)),
        ("in the log twice", lambda outcome: outcome.twice, at_most(0.0)),
        ("out of order", lambda outcome: outcome.disordered, at_most(0.0)),
    )
    return tuple(
        Figure(name=f"{what}: {name}", unit="", target=target, measure=partial(faults, course=course, count=count))
        for name, count, target in counts
    )


FIGURES = (
    *figures_of(cut, f"link cut {CUT_S:g} s, {CUTS} times"),
    *figures_of(stopped, f"both ends stopped for {STOP_S:g} s"),
    *figures_of(killed, f"vehicle's program killed -9, {KILLS} times"),
    Figure(
        name=f"publisher with spool, {SIZE_BYTES} B, sent to acknowledged",
        unit="1/s",
        target=None,
        measure=partial(of_rates, value=lambda rates: rates.publisher_hz),
    ),
    Figure(
        name="the same over bare put() in a loop, nothing kept and nothing acknowledged",
        unit="1",
        target=None,
        measure=partial(of_rates, value=lambda rates: rates.publisher_hz / rates.bare_hz),
    ),
)

"""The demonstration: how long it takes, and that its projections come back equal from the log."""

from figures.figure import Figure, Measurement, at_most
from figures.replayed import unchanged_by_replay
from figures.workbench import Outcome, Workbench


def driven(bench: Workbench) -> Outcome:
    """The demonstration with its default seed."""
    return bench.run("demo", "--out", bench.path("demo"), "--json")


def wall_seconds(bench: Workbench) -> Measurement:
    """The duration of the whole command, start-up included."""
    outcome = driven(bench)
    return Measurement(value=outcome.wall_s, command=outcome.command)


FIGURES = (
    Figure(name="wall time", unit="s", target=at_most(90.0), measure=wall_seconds),
    unchanged_by_replay("demo", driven),
)

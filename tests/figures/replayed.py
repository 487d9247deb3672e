"""What holds for every map: its projections come back equal from the log."""

from collections.abc import Callable

from figures.figure import Figure, Measurement, at_most
from figures.workbench import Workbench


def unchanged_by_replay(folder: str, prepare: Callable[[Workbench], object]) -> Figure:
    """How many rows of the projections in a data directory differ after a replay."""

    def measure(bench: Workbench) -> Measurement:
        prepare(bench)
        outcome = bench.run("replay", "--data", bench.path(folder), "--json")
        return Measurement(value=outcome.at("differences"), command=outcome.command)

    return Figure(name="rows that differ after a replay", unit="", target=at_most(0.0), measure=measure)

"""MRCLAM 6: five robots in one map, its surveyed landmarks as anchors."""

from statistics import fmean

from figures.figure import Figure, Measurement, at_most
from figures.replayed import unchanged_by_replay
from figures.workbench import Outcome, Workbench

DRAWS = 100
ROBOTS = tuple(f"robot{number}" for number in range(1, 6))


def built(bench: Workbench) -> Outcome:
    """The joint map, all 15 landmarks tied."""
    raw, data = bench.path("raw"), bench.path("data")
    bench.run("convert", "mrclam", bench.drive("mrclam6"), raw)
    bench.run("ingest", *(f"{raw}/{robot}.mcap" for robot in ROBOTS), "--data", data)
    bench.run("anchors", "import", f"{raw}/anchors.geojson", "--data", data)
    return bench.run("build", "--data", data, "--method", "anchored", "--json")


def left_out(tied: int, limit: float) -> Figure:
    """Mean error of the landmarks not tied."""

    def measure(bench: Workbench) -> Measurement:
        built(bench)
        outcome = bench.run(
            "evaluate", "leave-out", "--data", bench.path("data"),
            "--tied", tied, "--draws", DRAWS, "--seed", 0, "--json",
        )  # fmt: skip
        return Measurement(value=outcome.at("error_m.mean"), command=outcome.command)

    name = f"mean error of the landmarks not tied, {tied} tied, {DRAWS} draws"
    return Figure(name=name, unit="m", target=at_most(limit), measure=measure)


def trajectory_rmse(bench: Workbench) -> Measurement:
    """The mean over the robots of each one's RMSE against truth."""
    built(bench)
    truth = f"{bench.path('raw')}/truth.csv"
    outcome = bench.run("evaluate", "truth", "--data", bench.path("data"), "--truth", truth, "--json")
    value = fmean(outcome.at(f"vehicles.{robot}.error_m.rmse") for robot in ROBOTS)
    return Measurement(value=value, command=outcome.command)


FIGURES = (
    unchanged_by_replay("data", built),
    left_out(3, 0.05),
    left_out(8, 0.04),
    Figure(
        name="trajectory RMSE, mean of the robots, 15 tied", unit="m", target=at_most(0.085), measure=trajectory_rmse
    ),
)

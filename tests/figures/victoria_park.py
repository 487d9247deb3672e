"""Victoria Park: GPS withheld 30 s of every 60 s, the antenna's distance to the withheld fixes, and the cold start."""

from figures.figure import Figure, Measurement, at_most, between
from figures.replayed import unchanged_by_replay
from figures.workbench import Outcome, Workbench

PERIOD_S, DURATION_S = 60, 30
OFFSETS_S = (0, 30)
PAPER, BEST = "paper", "best"  # --edges: an edge every 10 m of sigma 5 m, or the settings judged best


def cold_start(bench: Workbench) -> tuple[Outcome, ...]:
    """Convert, ingest and build, each a process of its own."""
    raw, data = bench.path("raw"), bench.path("data")
    return (
        bench.run("convert", "victoria-park", bench.drive("victoria_park"), raw),
        bench.run("ingest", f"{raw}/utecar.mcap", "--data", data),
        bench.run("build", "--data", data, "--json"),
    )


def withheld(bench: Workbench, *, edges: str) -> Outcome:
    """What `evaluate gnss` says of one kind of edges: both offsets together withhold every fix once."""
    cold_start(bench)
    offsets = [word for offset_s in OFFSETS_S for word in ("--withhold-offset-s", offset_s)]
    return bench.run(
        "evaluate", "gnss", "--data", bench.path("data"), "--method", "loose", "--edges", edges,
        "--withhold-period-s", PERIOD_S, "--withhold-duration-s", DURATION_S, *offsets, "--json",
    )  # fmt: skip


def withheld_figure(name: str, path: str, limit: float | None, *, edges: str) -> Figure:
    """One number of `evaluate gnss`."""

    def measure(bench: Workbench) -> Measurement:
        outcome = withheld(bench, edges=edges)
        return Measurement(value=outcome.at(path), command=outcome.command)

    target = None if limit is None else at_most(limit)
    return Figure(name=name, unit="m", target=target, measure=measure)


def start_seconds(bench: Workbench) -> Measurement:
    """The three commands' durations together."""
    steps = cold_start(bench)
    return Measurement(value=sum(step.wall_s for step in steps), command=" && ".join(step.command for step in steps))


def landmark_count(bench: Workbench) -> Measurement:
    """The landmarks of the built map."""
    build = cold_start(bench)[-1]
    return Measurement(value=build.at("landmarks.count"), command=build.command)


FIGURES = (
    unchanged_by_replay("data", cold_start),
    Figure(name="convert, ingest and build from a cold start", unit="s", target=at_most(60.0), measure=start_seconds),
    Figure(name="landmarks found", unit="", target=between(180, 350), measure=landmark_count),
    *(
        withheld_figure(name, path, limit, edges=edges)
        for name, path, limit, edges in (
            ("paper's edges, median", "error_m.median", 1.0, PAPER),
            ("paper's edges, mean", "error_m.mean", 1.2, PAPER),
            ("paper's edges, p95", "error_m.p95", 3.0, PAPER),
            ("paper's edges, between the two paths, median", "path_difference_everywhere_m.median", 0.5, PAPER),
            ("paper's edges, the same at the withheld fixes only", "path_difference_m.median", None, PAPER),
            ("best settings, median", "error_m.median", 0.75, BEST),
            ("best settings, mean", "error_m.mean", 1.0, BEST),
            ("best settings, p95", "error_m.p95", 2.5, BEST),
            ("best settings, between the two paths, median", "path_difference_everywhere_m.median", 0.25, BEST),
            ("best settings, the same at the withheld fixes only", "path_difference_m.median", None, BEST),
            ("filter alone, median", "filter_error_m.median", 2.5, PAPER),
        )
    ),
)

"""Vehicles that find themselves in a map by a handful of landmarks: simulated places, and a robot in others' map."""

from collections.abc import Callable
from functools import partial

from figures.campus import driven, folder
from figures.figure import Bounds, Figure, Measurement, at_least, at_most
from figures.workbench import Outcome, Workbench

SEEDS = range(1, 5)
PLACES = 250  # of each seed: 1,000 in all
PRIOR_SIGMA_M, CLUTTER_SHARE = 15, 0.2
ROBOT, OTHERS = "robot1", tuple(f"robot{number}" for number in range(1, 6))
WINDOW_S = 15


def found(bench: Workbench) -> list[Outcome]:
    """What `evaluate relocalise` says of each seed's campus."""
    outcomes = []
    for seed in SEEDS:
        driven(bench, seed)
        data = bench.path(folder(seed, known=False))
        outcomes.append(
            bench.run(
                "evaluate",
                "relocalise",
                "--data",
                data,
                "--truth",
                f"{data}/truth/truth.csv",
                "--places",
                PLACES,
                "--prior-sigma-m",
                PRIOR_SIGMA_M,
                "--clutter-share",
                CLUTTER_SHARE,
                "--seed",
                seed,
                "--json",
            )  # fmt: skip
        )
    return outcomes


def over_places(bench: Workbench, *, path: str, combined: Callable[[list[float]], float]) -> Measurement:
    """One number of all seeds together."""
    outcomes = found(bench)
    value = combined([outcome.at(path) for outcome in outcomes])
    return Measurement(value=value, command=f"{outcomes[0].command}  # and {len(outcomes) - 1} other seeds")


def of_confident(bench: Workbench, *, path: str) -> Measurement:
    """A share of the confident answers of all seeds together."""
    outcomes = found(bench)
    counts = [outcome.at("error_m.count") for outcome in outcomes]
    value = sum(n * outcome.at(path) for n, outcome in zip(counts, outcomes, strict=True)) / max(1.0, sum(counts))
    return Measurement(value=value, command=f"{outcomes[0].command}  # and {len(outcomes) - 1} other seeds")


def robot_found(bench: Workbench, *, path: str) -> Measurement:
    """A number of the robot's relocalisation in the map that the other four made."""
    raw, data = bench.path("mrclam-raw"), bench.path("mrclam")
    bench.run("convert", "mrclam", bench.drive("mrclam6"), raw)
    bench.run("ingest", *(f"{raw}/{robot}.mcap" for robot in OTHERS), "--data", data)
    bench.run("anchors", "import", f"{raw}/anchors.geojson", "--data", data)
    bench.run("drives", "exclude", ROBOT, "--data", data, "--reason", "relocalised in the others' map")
    bench.run("build", "--data", data, "--method", "anchored", "--json")
    outcome = bench.run(
        "evaluate", "relocalise-drive", ROBOT, "--data", data, "--truth", f"{raw}/truth.csv", "--window-s", WINDOW_S,
        "--json",
    )  # fmt: skip
    return Measurement(value=outcome.at(path), command=outcome.command)


def figure(name: str, unit: str, target: Bounds | None, measure: Callable[[Workbench], Measurement]) -> Figure:
    """A figure of this group."""
    return Figure(name=name, unit=unit, target=target, measure=measure)


def mean(values: list[float]) -> float:
    """The mean of seeds with as many places each."""
    return sum(values) / len(values)


FIGURES = (
    figure(
        "campus: answered with confidence",
        "1",
        at_least(0.85),
        partial(over_places, path="confident_share", combined=mean),
    ),
    figure(
        "campus: of those within 0.5 m of where the map has the vehicle",
        "1",
        at_least(0.99),
        partial(of_confident, path="within_half_a_metre_in_map_share"),
    ),
    figure(
        "campus: of those within 0.5 m of truth, the map's own error included",
        "1",
        None,
        partial(of_confident, path="within_half_a_metre_share"),
    ),
    figure("campus: off by over 2 m", "", at_most(0.0), partial(over_places, path="off_by_2_m", combined=sum)),
    figure("campus: p99", "s", at_most(0.05), partial(over_places, path="duration_s.p99", combined=max)),
    figure("MRCLAM, no prior: answered with confidence", "1", None, partial(robot_found, path="confident_share")),
    figure("MRCLAM, no prior: error of those, mean", "m", None, partial(robot_found, path="error_m.mean")),
    figure("MRCLAM, no prior: error of those, largest", "m", None, partial(robot_found, path="error_m.max")),
)

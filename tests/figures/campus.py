"""The simulated campus over ten seeds: held-out labels, landmarks against truth, consistency, gate, bad anchors."""

import json
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from math import cos, pi, radians, sin
from pathlib import Path
from random import Random
from statistics import fmean

from figures.figure import Bounds, Figure, Measurement, at_least, at_most, between
from figures.replayed import unchanged_by_replay
from figures.workbench import Outcome, Workbench

SEEDS = range(1, 11)
MOST_LABELLED = ("--image", "most-labelled")  # the quadrangle: 30 of the 50 labels
DRAWS = 100
CURVE_DRAWS = 1000
FEW_SEEDS = range(1, 4)  # for what needs a second build
RE_SOLVED_DRAWS = 10
MISPLACED_SHARE, MISPLACED_M = 0.3, 4.0
METRES_PER_DEGREE = 111_195.0  # of latitude, mean


def folder(seed: int, *, known: bool) -> str:
    """The name of one seed's data directory; `known`: detections say which landmark they are of."""
    return f"campus-{seed}-known" if known else f"campus-{seed}"


def driven(bench: Workbench, seed: int, *, known: bool = False) -> Outcome:
    """The campus of one seed, from raw logs to the anchored map."""
    signatures = ("--known-signatures",) if known else ()
    return bench.run("demo", "--out", bench.path(folder(seed, known=known)), "--seed", seed, *signatures, "--json")


def left_out(bench: Workbench, seed: int, *words: str | int, known: bool = False) -> Outcome:
    """What `evaluate leave-out` says on one seed's campus."""
    driven(bench, seed, known=known)
    data = bench.path(folder(seed, known=known))
    return bench.run("evaluate", "leave-out", "--data", data, *words, "--seed", seed, "--json")


def over(seeds: Iterable[int], outcome_of: Callable[[int], Outcome]) -> list[Outcome]:
    """An outcome a seed, as many seeds at once as there are cores."""
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        return list(pool.map(outcome_of, seeds))


def mean_over_seeds(outcome_of: Callable[[int], Outcome], path: str) -> Measurement:
    """The mean of one number over the seeds; the command shown is the first seed's."""
    outcomes = over(SEEDS, outcome_of)
    value = fmean(outcome.at(path) for outcome in outcomes)
    return Measurement(value=value, command=f"{outcomes[0].command}  # and {len(outcomes) - 1} other seeds")


def held_out(name: str, target: Bounds | None, *words: str | int, known: bool = False) -> Figure:
    """The mean error of held-out labels."""

    def measure(bench: Workbench) -> Measurement:
        return mean_over_seeds(lambda seed: left_out(bench, seed, *words, known=known), "error_m.mean")

    return Figure(name=f"held-out labels, {name}, mean", unit="m", target=target, measure=measure)


def of_demo(name: str, unit: str, target: Bounds | None, path: str) -> Figure:
    """One number of `demo --json`, mean over the seeds."""

    def measure(bench: Workbench) -> Measurement:
        return mean_over_seeds(lambda seed: driven(bench, seed), path)

    return Figure(name=name, unit=unit, target=target, measure=measure)


def curve_seconds(bench: Workbench) -> Measurement:
    """The duration of the whole leave-n-out curve on the first seed, from the reduction its build kept."""
    driven(bench, SEEDS[0])
    data = bench.path(folder(SEEDS[0], known=False))
    outcome = bench.run("evaluate", "leave-out", "--data", data, "--draws", CURVE_DRAWS, "--seed", 0, "--json")
    return Measurement(value=outcome.wall_s, command=outcome.command)


def rebuilt(bench: Workbench, seed: int, name: str, labels: str, *build: str) -> Outcome:
    """What `evaluate truth` says of a seed's drives built again with other labels or other words."""
    driven(bench, seed)
    source, data = bench.path(folder(seed, known=False)), bench.path(f"{name}-{seed}")
    logs = sorted(str(log) for log in Path(source, "vehicles").glob("*.mcap"))
    bench.run("ingest", *logs, "--data", data)
    bench.run("anchors", "import", labels, "--data", data)
    bench.run("build", "--data", data, "--method", "anchored", *build, "--json")
    return bench.run("evaluate", "truth", "--data", data, "--truth", f"{source}/truth/truth.csv", "--json")


def clean_labels(bench: Workbench, seed: int) -> str:
    """The labels as the campus has them."""
    return f"{bench.path(folder(seed, known=False))}/anchors.geojson"


def misplaced_labels(bench: Workbench, seed: int) -> str:
    """A file with 30 % of the labels moved by `MISPLACED_M` in a random direction: labels of something else."""
    driven(bench, seed)
    collection = json.loads(Path(clean_labels(bench, seed)).read_text(encoding="utf-8"))
    random = Random(seed)
    features = collection["features"]
    for feature in random.sample(features, round(MISPLACED_SHARE * len(features))):
        direction_rad = random.uniform(0.0, 2.0 * pi)
        lon_deg, lat_deg = feature["geometry"]["coordinates"][:2]
        north_deg = MISPLACED_M * sin(direction_rad) / METRES_PER_DEGREE
        east_deg = MISPLACED_M * cos(direction_rad) / (METRES_PER_DEGREE * cos(radians(lat_deg)))
        feature["geometry"]["coordinates"] = [lon_deg + east_deg, lat_deg + north_deg]
    moved = Path(bench.path(f"misplaced-{seed}.geojson"))
    moved.write_text(json.dumps(collection), encoding="utf-8")
    return str(moved)


def gain_of_offsets(bench: Workbench) -> Measurement:
    """What the images' own offsets gain."""
    bare = over(FEW_SEEDS, lambda seed: rebuilt(bench, seed, "bare", clean_labels(bench, seed), "--no-image-offsets"))
    gain = fmean(
        o.at("error_m.mean") - driven(bench, s).at("error_m.mean") for s, o in zip(FEW_SEEDS, bare, strict=True)
    )
    return Measurement(value=gain, command=f"{bare[0].command}  # less the demo's, mean of {len(bare)} seeds")


def misplaced_ratio(bench: Workbench) -> Measurement:
    """The landmark error with misplaced labels over the clean one."""
    wrong = over(FEW_SEEDS, lambda seed: rebuilt(bench, seed, "misplaced", misplaced_labels(bench, seed)))
    clean = fmean(driven(bench, seed).at("error_m.mean") for seed in FEW_SEEDS)
    ratio = fmean(outcome.at("error_m.mean") for outcome in wrong) / clean
    return Measurement(value=ratio, command=f"{wrong[0].command}  # over the demo's, {len(wrong)} seeds")


def re_solve_difference(bench: Workbench, *, tied: int) -> Measurement:
    """How far the linear reduction's mean error is from full re-solves'."""
    outcome = left_out(bench, SEEDS[0], "--tied", tied, "--draws", RE_SOLVED_DRAWS, "--re-solve")
    return Measurement(value=abs(outcome.at("re_solve.mean_error_m")), command=outcome.command)


FIGURES = (
    of_demo("landmark error of the anchored map against truth, mean", "m", at_most(0.30), "error_m.mean"),
    of_demo("the same, the seed's common shift removed", "m", at_most(0.15), "error_without_shift_m.mean"),
    of_demo("NEES per degree of freedom, joint over landmarks", "1", between(0.7, 1.4), "nees_per_dof"),
    of_demo("fixes accepted inside the car park", "", at_most(0.0), "gate.car_park_accepted"),
    of_demo("good fixes rejected after re-acquisition", "1", at_most(0.07), "gate.good_rejected_share"),
    held_out("none tied", None, "--tied", 0, "--draws", 1),
    held_out("29 of 30 tied in the quadrangle", at_most(0.20), "--tied", 29, "--draws", DRAWS, *MOST_LABELLED),
    held_out("49 of 50 tied over all images", at_most(0.22), "--tied", 49, "--draws", DRAWS),
    held_out("29 of 30, known association", at_most(0.14), "--tied", 29, "--draws", DRAWS, *MOST_LABELLED, known=True),
    held_out("49 of 50, known association", at_most(0.15), "--tied", 49, "--draws", DRAWS, known=True),
    Figure(
        name="landmark error without image offsets less that with them, mean",
        unit="m",
        target=at_least(0.0),
        measure=gain_of_offsets,
    ),
    Figure(
        name="landmark error with 30 % of the labels 4 m off, over the clean one",
        unit="1",
        target=at_most(1.1),
        measure=misplaced_ratio,
    ),
    *(
        Figure(
            name=f"leave-n-out against full re-solves, n = {tied}, mean error differs by",
            unit="m",
            target=at_most(0.005),
            measure=partial(re_solve_difference, tied=tied),
        )
        for tied in (3, 10, 29, 49)
    ),
    Figure(
        name=f"leave-n-out curve, n = 0 to 49, {CURVE_DRAWS} draws each",
        unit="s",
        target=at_most(60.0),
        measure=curve_seconds,
    ),
    unchanged_by_replay(folder(SEEDS[0], known=False), lambda bench: driven(bench, SEEDS[0])),
)

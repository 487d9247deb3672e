"""The simulated campus over ten seeds: held-out labels, landmarks against truth, consistency, gate, bad anchors."""

from statistics import fmean

from figures.figure import Bounds, Figure, Measurement, at_most, between
from figures.workbench import Outcome, Workbench

SEEDS = range(10)
MOST_LABELLED = ("--image", "most-labelled")  # the quadrangle: 30 of the 50 labels
DRAWS = 100
CURVE_DRAWS = 1000


def driven(bench: Workbench, seed: int) -> Outcome:
    """The campus of one seed, from raw logs to the anchored map."""
    return bench.run("demo", "--out", bench.path(f"campus-{seed}"), "--seed", seed, "--json")


def left_out(bench: Workbench, seed: int, *words: str | int) -> Outcome:
    """What `evaluate leave-out` says on one seed's campus."""
    driven(bench, seed)
    return bench.run("evaluate", "leave-out", "--data", bench.path(f"campus-{seed}"), *words, "--seed", seed, "--json")


def mean_over_seeds(outcomes: list[Outcome], path: str) -> Measurement:
    """The mean of one number over the seeds; the command shown is the first seed's."""
    value = fmean(outcome.at(path) for outcome in outcomes)
    return Measurement(value=value, command=f"{outcomes[0].command}  # and {len(outcomes) - 1} other seeds")


def held_out(name: str, target: Bounds | None, *words: str | int) -> Figure:
    """The mean error of held-out labels."""

    def measure(bench: Workbench) -> Measurement:
        return mean_over_seeds([left_out(bench, seed, *words) for seed in SEEDS], "error_m.mean")

    return Figure(name=f"held-out labels, {name}, mean", unit="m", target=target, measure=measure)


def of_demo(name: str, unit: str, target: Bounds | None, path: str) -> Figure:
    """One number of `demo --json`, mean over the seeds."""

    def measure(bench: Workbench) -> Measurement:
        return mean_over_seeds([driven(bench, seed) for seed in SEEDS], path)

    return Figure(name=name, unit=unit, target=target, measure=measure)


FIGURES = (
    of_demo("landmark error of the anchored map against truth, mean", "m", at_most(0.30), "error_m.mean"),
    of_demo("the same, the seed's common shift removed", "m", at_most(0.15), "error_without_shift_m.mean"),
    of_demo("NEES per degree of freedom, joint over landmarks", "1", between(0.7, 1.4), "nees_per_dof"),
    of_demo("fixes accepted inside the car park", "", at_most(0.0), "gate.car_park_accepted"),
    of_demo("good fixes rejected after re-acquisition", "1", at_most(0.07), "gate.good_rejected_share"),
    held_out("0 tied", None, "--tied", 0, "--draws", 1),
    held_out(
        "29 of 30 tied in the quadrangle", at_most(0.20), "--tied", 29, "--draws", DRAWS, "--image", "most-labelled"
    ),
    held_out("49 of 50 tied over all images", at_most(0.22), "--tied", 49, "--draws", DRAWS),
)

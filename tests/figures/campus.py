"""The simulated campus over ten seeds: held-out labels, landmarks against truth, consistency, gate, bad anchors."""

from statistics import fmean

from figures.figure import Bounds, Figure, Measurement, at_most, between
from figures.replayed import unchanged_by_replay
from figures.workbench import Outcome, Workbench

SEEDS = range(1, 11)
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


def curve_seconds(bench: Workbench) -> Measurement:
    """The duration of the whole leave-n-out curve on the first seed, the solve it starts from included."""
    driven(bench, SEEDS[0])
    data = bench.path(f"campus-{SEEDS[0]}")
    outcome = bench.run("evaluate", "leave-out", "--data", data, "--draws", CURVE_DRAWS, "--seed", 0, "--json")
    return Measurement(value=outcome.wall_s, command=outcome.command)


FIGURES = (
    of_demo("landmark error of the anchored map against truth, mean", "m", at_most(0.30), "error_m.mean"),
    of_demo("the same, the seed's common shift removed", "m", at_most(0.15), "error_without_shift_m.mean"),
    of_demo("NEES per degree of freedom, joint over landmarks", "1", between(0.7, 1.4), "nees_per_dof"),
    of_demo("fixes accepted inside the car park", "", at_most(0.0), "gate.car_park_accepted"),
    of_demo("good fixes rejected after re-acquisition", "1", at_most(0.07), "gate.good_rejected_share"),
    held_out("none tied", None, "--tied", 0, "--draws", 1),
    held_out("29 of 30 tied in the quadrangle", at_most(0.20), "--tied", 29, "--draws", DRAWS, *MOST_LABELLED),
    held_out("49 of 50 tied over all images", at_most(0.22), "--tied", 49, "--draws", DRAWS),
    held_out(
        "29 of 30, known association",
        at_most(0.14),
        "--tied",
        29,
        "--draws",
        DRAWS,
        *MOST_LABELLED,
        "--known-association",
    ),
    held_out("49 of 50, known association", at_most(0.15), "--tied", 49, "--draws", DRAWS, "--known-association"),
    Figure(
        name=f"leave-n-out curve, n = 0 to 49, {CURVE_DRAWS} draws each",
        unit="s",
        target=at_most(60.0),
        measure=curve_seconds,
    ),
    unchanged_by_replay(f"campus-{SEEDS[0]}", lambda bench: driven(bench, SEEDS[0])),
)

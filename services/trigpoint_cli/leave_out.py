"""`trigpoint evaluate leave-out`: some anchors tied, the others measured."""

from dataclasses import dataclass

import click
import numpy as np

from trigpoint.errors import InputError
from trigpoint.events.solved import LabelReduction
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import logged_anchors, logged_maps, logged_verdicts
from trigpoint_cli.data_dir import DataDirectory, data_option
from trigpoint_cli.kept_solves import kept_solve
from trigpoint_cli.output import Answer, JsonObject, Screen, answering, metres
from trigpoint_cli.pipeline import read_inputs, settings_for, solve
from trigpoint_cli.re_solves import Agreement, agreement_with_re_solves
from trigpoint_evaluation.core.draws import (
    LeaveOutDraws,
    LeaveOutResult,
    drawn_labels,
    image_labels,
    left_out,
    left_out_curve,
)
from trigpoint_optimisation.core.solve import Solution


@dataclass(frozen=True, slots=True, kw_only=True)
class _Measured:
    """A reduction, the anchors there are (those that found a landmark are its labels), and its solution if solved."""

    reduction: LabelReduction
    anchor_count: int
    solution: Solution | None


@click.command("leave-out")
@data_option
@click.option("--tied", type=int, metavar="N", help="Tie so many anchors; every number of them by default.")
@click.option("--draws", type=int, default=100, show_default=True, metavar="K")
@click.option("--seed", type=int, default=0, show_default=True, metavar="S")
@click.option("--image", metavar="ID", help="Tie and measure the labels of this image only, or of `most-labelled`.")
@click.option("--blocked", is_flag=True, help="Hold out labels that lie together, not at random.")
@click.option("--re-solve", is_flag=True, help="Solve every draw in full too, and say how far the two differ.")
@answering
def leave_out(
    data: DataDirectory, tied: int | None, image: str | None, *, screen: Screen, **chosen: bool | int
) -> Answer:
    """Tie N anchors, measure the others: label minus landmark minus image offset, over K draws.

    Of the newest map version if it is anchored; else of one solved for this alone.
    Anchors that found no landmark count as tied first: there is nothing to measure them against.
    """
    settings = LeaveOutDraws(draws=chosen["draws"], seed=chosen["seed"], blocked=bool(chosen["blocked"]))
    if chosen["re_solve"] and (tied is None or image is not None):
        raise InputError("--re-solve goes with --tied and without --image: a whole curve would take hours")
    with data.opened_log() as log:
        measured = _measured(data, log, screen, anew=bool(chosen["re_solve"]))
    if not measured.reduction.labels:
        raise InputError(f"none of {measured.anchor_count} anchors is tied to a landmark: nothing can be left out")
    if tied is None:
        return _curve_answer(measured, settings, image, screen)
    result = left_out(measured.reduction, _with_landmark(measured, tied, image), settings, image=image)
    values = _values(result, measured) | {"blocked": settings.blocked, "image": image}
    if measured.solution is None or not chosen["re_solve"]:
        return Answer(values, (_line(result),))
    agreement = _agreement(measured.solution, measured.reduction, result, settings, screen)
    values["re_solve"] = {"prediction_difference_m": agreement.prediction_m, "mean_error_m": agreement.mean_error_m}
    line = f"full solves of these draws differ by {metres(agreement.mean_error_m)} in the mean error"
    return Answer(values, (_line(result), line))


def _curve_answer(measured: _Measured, settings: LeaveOutDraws, image: str | None, screen: Screen) -> Answer:
    with screen.part_of("leaving out") as progress:
        results = left_out_curve(measured.reduction, settings, image=image, progress=progress)
    values = _values(results[-1], measured) | {"blocked": settings.blocked, "image": image}
    curve = [_values(result, measured) for result in results]
    return Answer(values | {"curve": curve}, tuple(map(_line, results)))


def _measured(data: DataDirectory, log: EventLog, screen: Screen, *, anew: bool) -> _Measured:
    """The newest map version's reduction as its build kept it; else that of a solve now, from all the log holds."""
    maps, anchors = logged_maps(log), logged_anchors(log)
    if maps and maps[-1].head.method == "anchored" and not anew:
        kept = kept_solve(data, maps[-1].head.map_version)
        if kept is not None:
            return _Measured(reduction=kept.reduction, anchor_count=len(maps[-1].anchors), solution=None)
    settings = settings_for("anchored", anchors)
    solution = solve(read_inputs(log, screen), settings, screen, verdicts=logged_verdicts(log))
    return _Measured(reduction=solution.reduction(), anchor_count=len(anchors), solution=solution)


def _with_landmark(measured: _Measured, tied: int, image: str | None) -> int:
    """How many labels with a landmark are tied where `tied` anchors are, of all or of one image's."""
    reduction = measured.reduction
    count = len(reduction.labels) if image is None else len(image_labels(reduction, image)[1])
    without = measured.anchor_count - len(reduction.labels)
    return min(tied, count - 1) if 0 <= tied < count + without else tied


def _agreement(
    solution: Solution, reduction: LabelReduction, result: LeaveOutResult, settings: LeaveOutDraws, screen: Screen
) -> Agreement:
    draws = drawn_labels(reduction, result.tied, settings, np.arange(len(reduction.labels)))[: result.draws]
    with screen.part_of("solving every draw") as progress:
        return agreement_with_re_solves(solution.solved, reduction, draws, progress)


def _values(result: LeaveOutResult, measured: _Measured) -> JsonObject:
    return {
        "tied": result.tied,
        "anchors": {
            "count": result.count,
            "without_landmark": measured.anchor_count - len(measured.reduction.labels),
        },
        "draws": result.draws,
        "undetermined": result.undetermined,
        "error_m": result.error_m,
        "band_m": {"p5": result.band_m[0], "p95": result.band_m[1]},
    }


def _line(result: LeaveOutResult) -> str:
    return (
        f"{result.tied} of {result.count} tied: the others' error mean {metres(result.error_m.mean)}, "
        f"p95 {metres(result.error_m.p95)}; {result.draws} draws, their means {metres(result.band_m[0])} to "
        f"{metres(result.band_m[1])}"
    )

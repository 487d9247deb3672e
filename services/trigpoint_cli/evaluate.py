"""`trigpoint evaluate`: a map against withheld fixes, withheld anchors, or truth."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import click

from trigpoint.errors import InputError
from trigpoint.events.mapped import TrajectorySolved
from trigpoint.logs.as_of import log_as_of
from trigpoint.logs.readings import logged_verdicts
from trigpoint_cli.build import EDGES, METHODS
from trigpoint_cli.data_dir import DataDirectory, as_of_option, data_option
from trigpoint_cli.kept_solves import joint_covariance_m2, kept_solve
from trigpoint_cli.leave_out import leave_out
from trigpoint_cli.output import Answer, JsonObject, Screen, answering, metres
from trigpoint_cli.pipeline import Inputs, filter_drives, read_inputs, settings_for, solve, verdicts_of
from trigpoint_cli.relocalise import relocalise
from trigpoint_cli.relocalise_drive import relocalise_drive
from trigpoint_cli.truth_values import truth_lines, truth_values
from trigpoint_evaluation.app import Evaluated, evaluate_truth, logged_map, read_truth
from trigpoint_evaluation.core.gnss import (
    FilteredPath,
    GnssEvaluation,
    WithheldDistances,
    Withholding,
    evaluate_withheld,
    withheld_distances,
    withheld_fixes,
    without_withheld,
)
from trigpoint_filtering.core.track import FilteredDrive
from trigpoint_optimisation.core.solve import Solution
from trigpoint_optimisation.settings import Edges, Method, SolveSettings


@click.group("evaluate", help="Measure a map against withheld fixes, withheld anchors or truth.")
def command() -> None:
    """Group of the measures."""


command.add_command(leave_out)
command.add_command(relocalise)
command.add_command(relocalise_drive)


@command.command("gnss")
@data_option
@click.option("--withhold-period-s", "period_s", type=float, required=True, metavar="P")
@click.option("--withhold-duration-s", "duration_s", type=float, required=True, metavar="D")
@click.option(
    "--withhold-offset-s",
    "offsets_s",
    type=float,
    multiple=True,
    default=(0.0,),
    show_default=True,
    metavar="O",
    help="Several are solved one after the other and their fixes pooled.",
)
@click.option("--method", type=click.Choice(METHODS), help="Default: anchored where anchors are, else loose.")
@click.option(
    "--edges",
    type=click.Choice((*EDGES, "best")),
    default="best",
    show_default=True,
    help="How fixes enter; best for this measure is close: the fixes themselves are the reference.",
)
@answering
def gnss(
    data: DataDirectory,
    method: Method | None,
    edges: Edges | Literal["best"],
    offsets_s: tuple[float, ...],
    *,
    screen: Screen,
    **withhold: float,
) -> Answer:
    """Solve without some fixes, then measure the antenna's distance to them.

    Of every P seconds of a drive, D seconds of fixes are withheld, the first time O seconds after its start.
    """
    withholdings = tuple(Withholding(offset_s=offset_s, **withhold) for offset_s in offsets_s)
    with data.opened_log() as log:
        inputs = read_inputs(log, screen)
    settings = settings_for(method, inputs.anchors, edges="close" if edges == "best" else edges)
    total, vehicles = _withheld_evaluation(inputs, withholdings, settings, screen)
    values = _gnss_values(total) | {
        "method": settings.method,
        "edges": edges,
        "vehicles": {one.vehicle: _gnss_values(one) for one in vehicles},
    }
    lines = [_gnss_line(one.vehicle, one) for one in vehicles] + [_gnss_line("all", total)]
    return Answer(values, tuple(lines))


def _withheld_evaluation(
    inputs: Inputs, withholdings: Sequence[Withholding], settings: SolveSettings, screen: Screen
) -> tuple[GnssEvaluation, tuple[GnssEvaluation, ...]]:
    whole = filter_drives(inputs.drives, inputs.frame, screen)
    with_all = solve(inputs, settings, screen, verdicts=verdicts_of(whole), what="solving with all fixes")
    measured: list[WithheldDistances] = []
    for withholding in withholdings:
        measured += _withheld_distances(inputs, withholding, settings, screen, _trajectories(with_all))
    return evaluate_withheld(measured)


def _withheld_distances(
    inputs: Inputs,
    withholding: Withholding,
    settings: SolveSettings,
    screen: Screen,
    with_all: dict[tuple[str, str], TrajectorySolved],
) -> tuple[WithheldDistances, ...]:
    withheld = [withheld_fixes(drive, withholding, inputs.frame) for drive in inputs.drives]
    if not any(len(fixes.stamp_ns) for fixes in withheld):
        raise InputError(f"no fix of {len(inputs.drives)} drives falls into the withheld time: nothing to measure")
    seen = replace(inputs, drives=tuple(without_withheld(drive, withholding) for drive in inputs.drives))
    filtered = filter_drives(seen.drives, inputs.frame, screen)
    solution = solve(seen, settings, screen, verdicts=verdicts_of(filtered), what="solving without them")
    return withheld_distances(
        withheld,
        solved=_trajectories(solution),
        solved_with_all=with_all,
        filtered={(one.vehicle, one.boot_id): _path(one) for one in filtered},
    )


def _trajectories(solution: Solution) -> dict[tuple[str, str], TrajectorySolved]:
    return {(one.vehicle, one.boot_id): one for one in solution.map.trajectories}


def _path(filtered: FilteredDrive) -> FilteredPath:
    return FilteredPath(
        vehicle=filtered.vehicle,
        boot_id=filtered.boot_id,
        stamp_ns=filtered.stamp_ns,
        pose=filtered.pose,
        antenna_m=filtered.antenna_m,
    )


def _gnss_values(one: GnssEvaluation) -> JsonObject:
    return {
        "withheld": one.withheld,
        "error_m": one.error_m,
        "path_difference_m": one.path_difference_m,
        "path_difference_everywhere_m": one.path_difference_everywhere_m,
        "filter_error_m": one.filter_error_m,
    }


def _gnss_line(name: str, one: GnssEvaluation) -> str:
    return (
        f"{name}: {one.withheld} fixes withheld, antenna error median {metres(one.error_m.median)}, "
        f"mean {metres(one.error_m.mean)}, p95 {metres(one.error_m.p95)}; between the paths "
        f"{metres(one.path_difference_m.median)} median; filter alone {metres(one.filter_error_m.median)} median"
    )


@command.command("truth")
@data_option
@click.option("--truth", "truth_path", required=True, type=click.Path(path_type=Path), metavar="FILE")
@as_of_option
@answering
def truth(data: DataDirectory, truth_path: Path, as_of: int | None, *, screen: Screen) -> Answer:
    """Measure a map version against truth; nothing is aligned first."""
    known = read_truth(truth_path)
    with data.opened_log() as log:
        solved = logged_map(log, as_of=as_of)
        read = log_as_of(log, solved)
        inputs, verdicts = read_inputs(read, screen), logged_verdicts(read)
    evaluated = Evaluated(solved=solved, frame=inputs.frame, drives=inputs.drives, verdicts=verdicts)
    joint_m2 = joint_covariance_m2(kept_solve(data, solved.head.map_version), solved)
    found = evaluate_truth(evaluated, known, joint_covariance_m2=joint_m2)
    if found.landmarks.error_m.count == 0 and found.paths.error_m.count == 0:
        raise InputError(f"{truth_path}: nothing in it is near anything in the map: no error can be measured")
    return Answer(truth_values(found) | {"map_version": solved.head.map_version}, truth_lines(found))

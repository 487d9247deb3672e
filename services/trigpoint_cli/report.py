"""`trigpoint report`: the newest map version as one page."""

from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from platform import python_version

import click

from trigpoint.errors import InputError
from trigpoint.events.solved import LabelReduction
from trigpoint.logs.as_of import log_as_of
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import logged_anchors, logged_frame
from trigpoint_cli.data_dir import DataDirectory, as_of_option, data_option
from trigpoint_cli.kept_solves import joint_covariance_m2, kept_of, kept_solve
from trigpoint_cli.output import Answer, Screen, answering
from trigpoint_cli.pipeline import Built, Inputs, read_inputs, settings_for, solve
from trigpoint_evaluation.app import (
    Evaluated,
    TruthEvaluation,
    evaluate_truth,
    logged_estimates,
    logged_map,
    logged_refusals,
    read_truth,
)
from trigpoint_evaluation.core.draws import (
    MOST_LABELLED,
    LeaveOutDraws,
    LeaveOutResult,
    image_labels,
    left_out_curve,
    untied_residuals_m,
)
from trigpoint_evaluation.report.content import LeaveOutCurves, ReportContent, UntiedResiduals
from trigpoint_evaluation.report.page import report_page
from trigpoint_evaluation.settings import EvaluationSettings

SOFTWARE = ("trigpoint", "gtsam", "filterpy", "numpy", "scipy", "pyproj", "mcap", "eclipse-zenoh", "matplotlib")


@click.command("report")
@data_option
@click.option(
    "--truth", "truth_path", type=click.Path(path_type=Path), metavar="FILE", help="Truth to hold it against."
)
@as_of_option
@answering
def command(data: DataDirectory, truth_path: Path | None, as_of: int | None, *, screen: Screen) -> Answer:
    """Write the report of the newest map version to report.html in the data directory.

    Of version N, asked for by number, it is report-N.html.
    """
    if truth_path is None and data.truth.is_file():
        truth_path = data.truth
    path = report_path(data, as_of)
    with data.opened_log() as log:
        map_version = logged_map(log, as_of=as_of).head.map_version
        write_report(data, log, screen, truth_path=truth_path, as_of=as_of)
    size = path.stat().st_size
    values = {"report": str(path), "size_bytes": size, "map_version": map_version}
    return Answer(values, (f"wrote {path}, {size / 1e6:.1f} MB",))


def report_path(data: DataDirectory, as_of: int | None) -> Path:
    """Where the report of a map version stands, None for the newest."""
    return data.report if as_of is None else data.report.with_stem(f"{data.report.stem}-{as_of}")


def write_report(
    data: DataDirectory,
    log: EventLog,
    screen: Screen,
    *,
    truth_path: Path | None,
    built: Built | None = None,
    as_of: int | None = None,
) -> TruthEvaluation | None:
    """A map version's report in its place, and the evaluation against truth where there is truth.

    `built` is the newest map version where it was just built. What was not kept of it is solved again.
    """
    solved = logged_map(log, as_of=as_of)
    read = log_as_of(log, solved)
    estimates = logged_estimates(read)
    if built is None:
        inputs = read_inputs(read, screen)
    else:
        inputs = Inputs(frame=logged_frame(log), drives=built.drives, anchors=logged_anchors(log))
    kept = kept_solve(data, solved.head.map_version) if built is None else built.kept
    if kept is None and inputs.anchors:
        settings = settings_for("anchored", inputs.anchors)
        what = "solving for held-out anchors"
        kept = kept_of(solve(inputs, settings, screen, verdicts=estimates.verdicts, what=what))
    evaluated = Evaluated(solved=solved, frame=inputs.frame, drives=inputs.drives, verdicts=estimates.verdicts)
    joint_m2 = joint_covariance_m2(kept, solved)
    truth = None
    if truth_path is not None:
        truth = evaluate_truth(evaluated, read_truth(truth_path), joint_covariance_m2=joint_m2)
    content = ReportContent(
        evaluated=evaluated,
        anchors=inputs.anchors,
        poses=estimates.poses,
        refusals=logged_refusals(log),
        versions=(*((name, _version(name)) for name in SOFTWARE), ("Python", python_version())),
        truth=truth,
    )
    if kept is not None:
        content = _with_reduction(content, kept.reduction, screen)
    with screen.part_of("writing the report") as progress:
        _write(report_path(data, as_of), report_page(content, progress=progress))
    return truth


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed as a distribution"


def _with_reduction(content: ReportContent, reduction: LabelReduction, screen: Screen) -> ReportContent:
    """The content with what held-out anchors say."""
    if not reduction.labels:
        return content
    settings = EvaluationSettings()
    draws = LeaveOutDraws(draws=settings.curve_draws, seed=settings.curve_seed)
    with screen.part_of("leaving out") as progress:
        everywhere = left_out_curve(reduction, draws, progress=progress)
    blocked = left_out_curve(reduction, replace(draws, blocked=True))
    image, within = "", tuple[LeaveOutResult, ...]()
    if reduction.images:
        image, _ = image_labels(reduction, MOST_LABELLED)
        within = left_out_curve(reduction, draws, image=image)
    curves = LeaveOutCurves(everywhere=everywhere, blocked=blocked, image=image, within_image=within)
    untied = UntiedResiduals(labels=reduction.labels, residual_m=untied_residuals_m(reduction))
    return replace(content, curves=curves, untied=untied)


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: the report cannot be written: {error}") from error

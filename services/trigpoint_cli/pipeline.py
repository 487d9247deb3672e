"""The services put together in one process: what several commands do."""

from collections.abc import Sequence
from dataclasses import dataclass

from trigpoint.errors import InputError
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.drives import Drive
from trigpoint.events.estimated import FixJudged
from trigpoint.events.solved import SolvedMap
from trigpoint.geodesy.projection import MapFrame
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import logged_anchors, logged_drives, logged_frame
from trigpoint_cli.data_dir import DataDirectory
from trigpoint_cli.kept_solves import KeptSolve, keep, kept_of
from trigpoint_cli.output import Screen
from trigpoint_evaluation.app import logged_map
from trigpoint_filtering.app import filter_log
from trigpoint_filtering.core.track import FilteredDrive, filter_drive
from trigpoint_filtering.settings import FilterSettings
from trigpoint_landmarks.app import ProjectionReport, project
from trigpoint_optimisation.app import build
from trigpoint_optimisation.core.solve import Solution, solve_map
from trigpoint_optimisation.settings import Edges, Method, SolveSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class Inputs:
    """What a solve is made from, as the log has it."""

    frame: MapFrame
    drives: tuple[Drive, ...]
    anchors: tuple[AnchorLabelled, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Built:
    """A new map version: as the log has it, what was kept of its solve, the drives in it, and what the landmark
    database made of it."""

    solved: SolvedMap
    kept: KeptSolve
    drives: tuple[Drive, ...]
    projection: ProjectionReport


def read_inputs(log: EventLog, screen: Screen) -> Inputs:
    """Everything a solve needs. Raises InputError where something is missing."""
    frame = logged_frame(log)
    with screen.part_of("reading the log") as progress:
        drives = logged_drives(log, progress=progress)
    return Inputs(frame=frame, drives=drives, anchors=logged_anchors(log))


def _drives_of(solution: Solution) -> tuple[Drive, ...]:
    return tuple(prepared.drive for prepared in solution.solved.fleet.prepared)


def settings_for(
    method: Method | None,
    anchors: Sequence[AnchorLabelled],
    *,
    edges: Edges | None = None,
    image_offsets: bool = True,
) -> SolveSettings:
    """Settings of a method; without one `anchored` where there are anchors, else `loose`. Raises InputError."""
    if method == "anchored" and not anchors:
        raise InputError("method anchored: the log holds no anchor; `trigpoint anchors import` takes them in")
    chosen: Method = method if method is not None else ("anchored" if anchors else "loose")
    return SolveSettings(method=chosen, edges=edges, image_offsets=image_offsets)


def filter_drives(drives: Sequence[Drive], frame: MapFrame, screen: Screen) -> tuple[FilteredDrive, ...]:
    """Every drive filtered, with default settings."""
    filtered = []
    for drive in drives:
        with screen.part_of(f"filtering {drive.vehicle}") as progress:
            filtered.append(filter_drive(drive, frame, FilterSettings(), progress=progress))
    return tuple(filtered)


def verdicts_of(filtered: Sequence[FilteredDrive]) -> tuple[FixJudged, ...]:
    """The verdicts of all drives."""
    return tuple(verdict for one in filtered for verdict in one.judged)


def solve(
    inputs: Inputs, settings: SolveSettings, screen: Screen, *, verdicts: Sequence[FixJudged], what: str = "solving"
) -> Solution:
    """The map of the inputs; nothing is appended."""
    with screen.stages(what) as progress:
        return solve_map(inputs.drives, inputs.anchors, inputs.frame, settings, verdicts=verdicts, progress=progress)


def build_map(
    data: DataDirectory,
    log: EventLog,
    screen: Screen,
    *,
    method: Method | None,
    edges: Edges | None = None,
    image_offsets: bool = True,
) -> Built:
    """A new map version in the log and the landmark database: filtered where that was not done yet, then solved."""
    settings = settings_for(method, logged_anchors(log), edges=edges, image_offsets=image_offsets)
    with screen.part_of("filtering") as filtering:
        filter_log(log, FilterSettings(), progress=filtering)
    with screen.stages("solving") as solving:
        solution = build(log, settings, progress=solving)
    projection, solved = project_map(data, log, screen), logged_map(log)
    kept = kept_of(solution)
    keep(data, solved.head.map_version, kept)
    return Built(solved=solved, kept=kept, drives=_drives_of(solution), projection=projection)


def project_map(data: DataDirectory, log: EventLog, screen: Screen) -> ProjectionReport:
    """The landmark database brought up to the log."""
    with data.opened_database(read_only=False) as store, screen.part_of("projecting") as progress:
        return project(log, store, progress=progress)

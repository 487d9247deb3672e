"""`trigpoint demo`: a simulated campus, from raw logs to a georeferenced map, its errors and its report."""

import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from trigpoint.errors import InputError
from trigpoint.workers import workers
from trigpoint_cli.build import map_values
from trigpoint_cli.data_dir import DataDirectory
from trigpoint_cli.ingest import ingest_values
from trigpoint_cli.live import ingest_live
from trigpoint_cli.output import Answer, JsonObject, Screen, answering, metres
from trigpoint_cli.perceive import perceived
from trigpoint_cli.pipeline import Built, build_map
from trigpoint_cli.report import write_report
from trigpoint_cli.truth_values import truth_lines, truth_values
from trigpoint_evaluation.app import TruthEvaluation
from trigpoint_ingest.anchor_files import read_anchor_file
from trigpoint_ingest.anchors import import_anchors
from trigpoint_ingest.core.tally import IngestReport
from trigpoint_vehicle.aerial_files import write_viewer_configuration
from trigpoint_vehicle.app import record_campus
from trigpoint_vehicle.settings import SimulationSettings

MARK = "trigpoint-demo"  # a file that says: this directory may be made anew
VIEWER = "viewer.toml"  # a configuration of the HTTP service
DEFAULT_OUT = Path("trigpoint-demo")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Driven:
    data: DataDirectory
    ingest: IngestReport
    built: Built


@click.command("demo")
@click.option("--out", type=click.Path(path_type=Path), default=DEFAULT_OUT, metavar="DIR", help="Its data directory.")
@click.option("--seed", type=int, default=1, show_default=True, metavar="N", help="Which campus.")
@click.option("--vehicles", type=int, default=2, show_default=True, metavar="N", help="How many drive there.")
@click.option("--known-signatures", is_flag=True, help="Detections and labels say which landmark they are of.")
@click.option("--aerial", is_flag=True, help=f"Aerial pictures of it too, and DIR/{VIEWER}, which shows them.")
@click.option("--lidar", is_flag=True, help="Vehicles carry a lidar: some 500 MB of points a kilometre.")
@click.option("--points-only", is_flag=True, help="With --lidar: no simulated detections, points only.")
@answering
def command(out: Path, *, aerial: bool, screen: Screen, **simulated: Any) -> Answer:
    """Simulate a campus and take it all the way to a map, a report and its errors.

    The vehicles' messages travel over Zenoh. DIR is a data directory afterwards: every other command works on it.
    """
    settings = SimulationSettings(**simulated)
    data = _emptied(out)
    screen.note(f"simulating campus {settings.seed} with {settings.vehicles} vehicles")
    logs = _simulated(settings, data, aerial=aerial)
    with data.new_log() as log:
        with screen.counting("driving, over Zenoh", unit="messages") as progress:
            ingested = ingest_live(logs, log, progress)
        import_anchors(read_anchor_file(data.anchors), log)
        if settings.lidar:
            with workers() as some:
                perceived(log, data, some, screen)
        built = build_map(data, log, screen, method="anchored")
        found = write_report(data, log, screen, truth_path=data.truth, built=built)
    assert found is not None, "truth was written above"
    return _answer(_Driven(data=data, ingest=ingested, built=built), found)


def _answer(driven: _Driven, found: TruthEvaluation) -> Answer:
    solved = driven.built.solved
    values = map_values(solved) | {"ingest": ingest_values(driven.ingest), "report": str(driven.data.report)}
    measured = truth_values(found)
    values |= {name: value for name, value in measured.items() if name not in ("landmarks", "vehicles")}
    values["landmarks"] = map_values(solved)["landmarks"] | measured["landmarks"]
    values["vehicles"] = _vehicles(map_values(solved)["vehicles"], measured["vehicles"])
    landmarks = found.landmarks
    head = (
        f"map version {solved.head.map_version}: {len(solved.landmarks)} landmarks from "
        f"{driven.ingest.accepted} events, off by {metres(landmarks.error_m.mean)} on average"
    )
    return Answer(values, (head, *truth_lines(found), f"report: {driven.data.report}"), driven.ingest.complaints())


def _vehicles(drives: JsonObject, errors: JsonObject) -> JsonObject:
    return {name: {**drives.get(name, {}), **errors.get(name, {})} for name in sorted({*drives, *errors})}


def _emptied(out: Path) -> DataDirectory:
    """The directory without what an earlier demonstration left there. Raises InputError for anybody else's."""
    data, mark = DataDirectory(out), out / MARK
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: a file is there; --out names a directory")
    if out.is_dir() and any(out.iterdir()) and not mark.is_file():
        raise InputError(f"{out}: the directory is not empty and not a demonstration's; choose another --out")
    try:
        for made in (data.log, data.vehicles, data.solves, data.truth.parent, data.aerial):
            if os.path.lexists(made):
                shutil.rmtree(made)
        for file in (data.report, data.anchors, out / VIEWER, *out.glob(f"{data.database.name}*")):
            file.unlink(missing_ok=True)
        out.mkdir(parents=True, exist_ok=True)
        mark.write_text("`trigpoint demo` made this directory and may make it anew.\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{out}: cannot be written: {error}") from error
    return data


def _simulated(settings: SimulationSettings, data: DataDirectory, *, aerial: bool) -> tuple[Path, ...]:
    """The vehicles' logs of a simulated campus; its truth goes where no service looks."""
    written = record_campus(settings, data.vehicles, aerial=data.aerial if aerial else None)
    if aerial:
        write_viewer_configuration(written.pictures, data.path, data.path / VIEWER)
    if written.truth is None or written.anchors is None:
        raise InputError(f"seed {settings.seed}: the simulation left no truth or no anchors")
    data.truth.parent.mkdir(parents=True, exist_ok=True)
    written.truth.replace(data.truth)
    if written.objects is not None:
        written.objects.replace(data.objects)
    written.anchors.replace(data.anchors)
    return written.logs

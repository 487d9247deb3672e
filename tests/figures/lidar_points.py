"""The campus solved from points only: no simulated detections, landmarks as perception finds them, against truth."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from figures.figure import Bounds, Figure, Measurement, at_most
from figures.lidar_campus import DRIVE, SEED
from figures.workbench import Outcome, Workbench
from perceived_campus.sights import SightErrors, sight_errors
from trigpoint.events.drives import Drive
from trigpoint.events.truth import truth_from_lines
from trigpoint.geodesy.projection import map_points_from_wgs84
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.readings import logged_anchors, logged_drives, logged_frame, logged_verdicts
from trigpoint_evaluation.core.landmark_truth import LandmarkTruthEvaluation, MappedPoints, evaluate_landmarks
from trigpoint_optimisation.core.solve import solve_map
from trigpoint_optimisation.settings import CalibrationPriors, DetectionSettings, MatchedSettings, SolveSettings
from trigpoint_vehicle.app import Written, casting_ahead, write_conversion
from trigpoint_vehicle.core.campus import simulate_campus
from trigpoint_vehicle.core.lidar.scanned_campus import conversion_with_points, scanned_campus
from trigpoint_vehicle.core.lidar_settings import CarriedLidar

DRIVES = replace(DRIVE, vehicles=2, carried=replace(DRIVE.carried, landmarks=False))
SOLVED = SolveSettings(method="anchored")
HELD_M = 1e-6  # 1-sigma of a range offset that is not solved for
LITTLE = 1e-3  # of the variance: as good as none
WITHOUT_ODOMETRY = replace(SOLVED, matched=MatchedSettings(used=False))
GAPS = "landmarks in 40 of 120 s only"
SEEN_NS, TURN_NS = 40_000_000_000, 120_000_000_000
VARIANTS = {
    "lidar odometry left out": WITHOUT_ODOMETRY,
    "range offsets held at zero": replace(SOLVED, calibration=CalibrationPriors(range_offset_m=HELD_M)),
    "no error shared by a pass": replace(SOLVED, detections=DetectionSettings(shared_share=LITTLE)),
    GAPS: SOLVED,
    f"{GAPS}, lidar odometry left out": WITHOUT_ODOMETRY,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Mapped:
    """The data directory of the perceived and solved drives, their truth, and what the map's errors are."""

    data: Path
    truth: Path
    errors: Outcome


@cache
def _recorded(folder: Path) -> Written:
    """The drives of two vehicles, simulated and written: `trigpoint demo` has no shorter loop."""
    campus = simulate_campus(SEED, DRIVES)
    with casting_ahead() as casting:
        scanned = scanned_campus(campus, DRIVES, CarriedLidar(), seed=SEED, casting=casting)
        return write_conversion(conversion_with_points(scanned), folder / "points-vehicles")


def mapped(bench: Workbench) -> Mapped:
    """The drives taken in, perceived and built, each once."""
    written, data = _recorded(bench.folder), bench.path("points")
    assert written.truth is not None, "the campus knows its truth"
    assert written.anchors is not None, "the campus has labels"
    bench.run("ingest", *map(str, written.logs), "--data", data)
    bench.run("anchors", "import", str(written.anchors), "--data", data)
    bench.run("perceive", "--data", data)
    bench.run("build", "--data", data, "--method", "anchored", "--json")
    errors = bench.run("evaluate", "truth", "--data", data, "--truth", str(written.truth), "--json")
    return Mapped(data=Path(data), truth=written.truth, errors=errors)


def of_map(bench: Workbench, *, path: str) -> Measurement:
    """A number of the map's errors."""
    errors = mapped(bench).errors
    return Measurement(value=errors.at(path), command=f"{errors.command}  # two vehicles on loops of 2 to 2.4 km")


def with_gaps(drive: Drive) -> Drive:
    """The drive with landmarks for `SEEN_NS` of every `TURN_NS` only."""
    since_ns = drive.detections.stamp_ns - drive.wheels.stamp_ns[0]
    return replace(drive, detections=drive.detections.chosen(np.nonzero(since_ns % TURN_NS < SEEN_NS)[0]))


@cache
def solved_otherwise(data: Path, truth: Path, variant: str) -> LandmarkTruthEvaluation:
    """The errors of the same drives' map by other settings."""
    log = McapLog(data / "log")
    frame, drives = logged_frame(log), logged_drives(log)
    if variant.startswith(GAPS):
        drives = tuple(with_gaps(drive) for drive in drives)
    solution = solve_map(drives, logged_anchors(log), frame, VARIANTS[variant], verdicts=logged_verdicts(log))
    with truth.open(encoding="utf-8") as lines:
        known = truth_from_lines(lines).landmarks
    lat_deg, lon_deg = np.array([one.lat_deg for one in known]), np.array([one.lon_deg for one in known])
    found = solution.map.landmarks
    return evaluate_landmarks(
        MappedPoints(point_m=np.array([one.position_m for one in found]), signature=("",) * len(found)),
        MappedPoints(point_m=map_points_from_wgs84(lat_deg, lon_deg, frame), signature=("",) * len(known)),
        joint_covariance_m2=solution.landmark_covariance_m2,
    )


def of_variant(bench: Workbench, *, variant: str, value: Callable[[LandmarkTruthEvaluation], float]) -> Measurement:
    """A number of a map by other settings."""
    whole = mapped(bench)
    errors = solved_otherwise(whole.data, whole.truth, variant)
    return Measurement(value=value(errors), command=f"figures.lidar_points.solved_otherwise  # {variant}")


def of_demo(bench: Workbench, *, path: str) -> Measurement:
    """A number of the whole demonstration from points only."""
    out = bench.path("points-demo")
    outcome = bench.run("demo", "--out", out, "--seed", SEED, "--lidar", "--points-only", "--json")
    return Measurement(value=outcome.at(path), command=outcome.command)


@cache
def sights_of(data: Path, truth: Path, kind: str) -> SightErrors:
    """The errors of the first vehicle's sights of one kind."""
    log = McapLog(data / "log")
    with truth.open(encoding="utf-8") as lines:
        return sight_errors(logged_drives(log)[0], truth_from_lines(lines), logged_frame(log), kind=kind)


def of_sights(bench: Workbench, *, kind: str, value: Callable[[SightErrors], float]) -> Measurement:
    """A number of the sights of one kind."""
    whole = mapped(bench)
    measured = value(sights_of(whole.data, whole.truth, kind))
    return Measurement(value=measured, command=f"figures.lidar_points.sights_of  # {kind}")


def _further(
    of_what: str, rows: Sequence[tuple[str, str, Callable[[Any], float]]], measure: Callable[..., Measurement]
) -> tuple[Figure, ...]:
    """Numbers reported beside those of the map."""
    return tuple(
        Figure(name=f"the same, {of_what}, {text}", unit=unit, target=None, measure=partial(measure, value=value))
        for text, unit, value in rows
    )


def _sights(kind: str) -> tuple[Figure, ...]:
    rows: tuple[tuple[str, str, Callable[[SightErrors], float]], ...] = (
        ("NEES per degree of freedom", "1", lambda sights: sights.nees_per_dof),
        ("inside their 95 % ellipses", "1", lambda sights: sights.inside_95),
        ("too far by, mean", "m", lambda sights: float(sights.too_far_m.mean())),
        ("correlation of that 4 s apart", "1", lambda sights: sights.lasting),
    )
    return _further(f"sights of a {kind}", rows, partial(of_sights, kind=kind))


def _figures(name: str, measure: Callable[..., Measurement], *, target: Bounds | None) -> tuple[Figure, ...]:
    """The errors of one map against truth, and whether its uncertainty is true."""
    rows = (
        (name, "m", target, "error_m.mean"),
        ("the same, 95th percentile", "m", None, "error_m.p95"),
        ("the same, common shift removed, mean", "m", None, "error_without_shift_m.mean"),
        ("the same, NEES per degree of freedom, joint over landmarks", "1", None, "nees_per_dof"),
        ("the same, NEES per degree of freedom, each landmark by itself", "1", None, "nees_per_dof_each"),
        ("the same, landmarks inside their 95 % ellipses", "1", None, "coverage_95"),
        ("the same, landmarks", "1", None, "landmarks.count"),
        ("the same, landmarks near nothing true", "1", None, "landmarks.unmatched"),
        ("the same, path error, mean", "m", None, "trajectory.error_m.mean"),
    )
    return tuple(
        Figure(name=text, unit=unit, target=bounds, measure=partial(measure, path=path))
        for text, unit, bounds, path in rows
    )


def _variant(variant: str) -> tuple[Figure, ...]:
    rows: tuple[tuple[str, str, Callable[[LandmarkTruthEvaluation], float]], ...] = (
        ("common shift removed, mean", "m", lambda errors: errors.error_without_shift_m.mean),
        ("NEES per degree of freedom, joint over landmarks", "1", lambda errors: errors.joint_nees_per_dof),
    )
    return _further(variant, rows, partial(of_variant, variant=variant))


FIGURES = (
    *_figures("campus end to end from points only, landmark truth error, mean", of_map, target=at_most(0.35)),
    *(figure for variant in VARIANTS for figure in _variant(variant)),
    *_sights("pole"),
    *_sights("corner"),
)
DEMO_FIGURES = _figures(
    "whole demonstration from points only, landmark truth error, mean", of_demo, target=at_most(0.35)
)

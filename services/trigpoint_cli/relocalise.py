"""`trigpoint evaluate relocalise`: whether vehicles find themselves in the map."""

import time
from collections.abc import Sequence
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from trigpoint.client.core.constellations import Constellation
from trigpoint.client.core.motion_fit import Expectation, PositionPrior
from trigpoint.client.core.relocalisation import Relocalised, relocalised
from trigpoint.errors import InputError
from trigpoint.events.solved import SolvedMap
from trigpoint.events.truth import Truth
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84
from trigpoint.logs.readings import logged_frame
from trigpoint_cli.data_dir import DataDirectory, as_of_option, data_option
from trigpoint_cli.output import Answer, Screen, answering, metres
from trigpoint_evaluation.app import logged_map, mapped_points, read_truth, true_points
from trigpoint_evaluation.core.landmark_truth import matched
from trigpoint_evaluation.core.relocalisation_trial import (
    TrialResult,
    TrialSettings,
    TrueWorld,
    kinds_by_match,
    trial_findings,
    trial_places,
    trial_result,
)

Floats = NDArray[np.float64]


class _Timed:
    """Finds places and keeps how long each took, in s."""

    def __init__(self) -> None:
        self.seconds: list[float] = []

    def __call__(
        self, observed: Constellation, known: Constellation, prior: PositionPrior, expected: Expectation
    ) -> Relocalised | None:
        began_s = time.perf_counter()
        found = relocalised(observed, known, prior, expected)
        self.seconds.append(time.perf_counter() - began_s)
        return found


@click.command("relocalise")
@data_option
@click.option("--truth", "truth_path", required=True, type=click.Path(path_type=Path), metavar="FILE")
@click.option("--places", type=int, default=1000, show_default=True, metavar="N", help="Random places on true paths.")
@click.option("--prior-sigma-m", type=float, default=15.0, show_default=True, metavar="M", help="Of the GPS prior.")
@click.option("--clutter-share", type=float, default=0.2, show_default=True, metavar="S", help="Of what is observed.")
@click.option("--seed", type=int, default=0, show_default=True, metavar="N")
@as_of_option
@answering
def relocalise(
    data: DataDirectory,
    truth_path: Path,
    as_of: int | None,
    *,
    screen: Screen,
    **trial: float | int,
) -> Answer:
    """Find random places by the landmarks observed there and a wide prior, and measure the answers against truth."""
    settings = TrialSettings(**trial)  # type: ignore[arg-type]
    with data.opened_log() as log:
        solved, frame = logged_map(log, as_of=as_of), logged_frame(log)
    known, world = known_landmarks(solved), _true_world(solved, read_truth(truth_path), frame, settings)
    find = _Timed()
    with screen.counting("finding places", total=settings.places) as advance:
        findings = []
        for finding in trial_findings(trial_places(world, settings), known, settings, find=find):
            findings.append(finding)
            advance(1)
    return _answer(solved, trial_result(findings), find.seconds)


def _answer(solved: SolvedMap, result: TrialResult, seconds: Sequence[float]) -> Answer:
    p50_s, p99_s = np.percentile(seconds, [50.0, 99.0])
    values = {
        "map_version": solved.head.map_version,
        "places": result.places,
        "confident_share": result.confident,
        "ambiguous_share": result.ambiguous,
        "unsupported_share": result.unsupported,
        "not_found_share": result.not_found,
        "error_m": result.error_m,
        "error_in_map_m": result.error_in_map_m,
        "heading_error_rad": result.heading_error_rad,
        "within_half_a_metre_share": result.within_half_a_metre,
        "within_half_a_metre_in_map_share": result.within_half_a_metre_in_map,
        "off_by_2_m": result.off_by_2_m,
        "nees_per_dof": result.nees_per_dof,
        "duration_s": {"p50": float(p50_s), "p99": float(p99_s)},
    }
    line = (
        f"{result.confident:.1%} of {result.places} places answered with confidence, of those "
        f"{result.within_half_a_metre:.1%} within 0.5 m ({result.within_half_a_metre_in_map:.1%} of where the map has "
        f"them) and {result.off_by_2_m} off by over 2 m; error mean {metres(result.error_m.mean)}, within the map "
        f"{metres(result.error_in_map_m.mean)}; {1e3 * p99_s:.0f} ms (p99)"
    )
    return Answer(values, (line,))


def known_landmarks(solved: SolvedMap) -> Constellation:
    """A map version's landmarks as a client holds them. Raises InputError for a map without any."""
    if not solved.landmarks:
        raise InputError(f"map version {solved.head.map_version} has no landmarks: nothing can be found by them")
    return Constellation(
        point_m=np.array([one.position_m for one in solved.landmarks]),
        covariance_m2=np.array([one.covariance_m2 for one in solved.landmarks]),
        kind=tuple(one.kind for one in solved.landmarks),
    )


def _true_world(solved: SolvedMap, truth: Truth, frame: MapFrame, settings: TrialSettings) -> TrueWorld:
    if not truth.landmarks or not truth.paths:
        raise InputError(
            f"truth has {len(truth.landmarks)} landmarks and {len(truth.paths)} paths: relocalisation needs both"
        )
    points = true_points(truth, frame)
    pairs = matched(mapped_points(solved), points)
    rng = np.random.default_rng([settings.seed, 37])
    kind = kinds_by_match([one.kind for one in solved.landmarks], pairs, len(points.point_m), rng)
    poses = [
        np.column_stack([map_points_from_wgs84(path.lat_deg, path.lon_deg, frame), path.heading_rad])
        for path in truth.paths
    ]
    map_error_m = np.full_like(points.point_m, np.nan)
    estimated_m = mapped_points(solved).point_m[pairs.estimated]
    map_error_m[pairs.truth] = estimated_m - points.point_m[pairs.truth]
    return TrueWorld(point_m=points.point_m, kind=kind, poses=np.vstack(poses), map_error_m=map_error_m)

"""`trigpoint evaluate relocalise-drive`: whether one vehicle finds itself in the map of the others by what it saw."""

from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from trigpoint.client.core.constellations import Constellation
from trigpoint.client.core.gathering import drifted, gathered
from trigpoint.client.core.motion_fit import Expectation, PositionPrior
from trigpoint.client.core.relocalisation import relocalised
from trigpoint.errors import InputError
from trigpoint.events.drives import Drive
from trigpoint.events.solved import SolvedMap
from trigpoint.events.truth import TruthPath
from trigpoint.geodesy.poses import transform_points
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84
from trigpoint.logs.readings import drives_of_vehicle, logged_frame
from trigpoint_cli.data_dir import DataDirectory, as_of_option, data_option
from trigpoint_cli.output import Answer, Screen, answering, metres
from trigpoint_cli.relocalise import known_landmarks
from trigpoint_evaluation.app import logged_map, read_truth
from trigpoint_evaluation.core.paths import poses_at
from trigpoint_evaluation.core.relocalisation_trial import Finding, TrialResult, finding_at, trial_result
from trigpoint_optimisation.core.odometry import dead_reckon
from trigpoint_optimisation.core.preparation import nominal_calibration
from trigpoint_optimisation.settings import SolveSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RANGE_SIGMA_M, RANGE_SIGMA_SHARE, BEARING_SIGMA_RAD = 0.03, 0.04, 0.03  # of a camera that nobody calibrated
EXPECTED = Expectation(clutter_per_m2=0.02, detected=0.7)
COMMON_SIGMA_M = 0.03
SAME_NAME_M = float("inf")  # sightings of one signature are of one landmark, wherever odometry put them


@dataclass(frozen=True, slots=True, kw_only=True)
class _Watch:
    """A drive's sightings in the frame of its odometry, in order of time, and the path they were made from."""

    stamp_ns: Ints
    sightings: Constellation
    path_stamp_ns: Ints
    pose: Floats
    distance_m: Floats
    turned_rad: Floats

    def around(self, at_ns: int, *, window_s: float, merged_m: float) -> Constellation:
        """What was sighted in the last `window_s` before an instant, around the base."""
        chosen = (self.stamp_ns <= at_ns) & (self.stamp_ns > at_ns - round(window_s * 1e9))
        base = self._on_path(self.pose, np.array([at_ns]))[0]
        since = [self._on_path(each, np.array([at_ns])) - self._on_path(each, self.stamp_ns[chosen]) for each in
                 (self.distance_m, self.turned_rad)]  # fmt: skip
        seen = drifted(self.sightings.only(chosen), base, path_m=since[0], turned_rad=since[1])
        return gathered(seen, base, merged_m=merged_m, common_sigma_m=COMMON_SIGMA_M)

    def _on_path(self, values: Floats, at_ns: Ints) -> Floats:
        t_s, at_s = (self.path_stamp_ns - self.path_stamp_ns[0]) * 1e-9, (at_ns - self.path_stamp_ns[0]) * 1e-9
        if values.ndim == 1:
            return np.asarray(np.interp(at_s, t_s, values))
        return np.column_stack([np.interp(at_s, t_s, column) for column in values.T])


@click.command("relocalise-drive")
@click.argument("vehicle")
@data_option
@click.option("--truth", "truth_path", required=True, type=click.Path(path_type=Path), metavar="FILE")
@click.option("--places", type=int, default=300, show_default=True, metavar="N", help="Random instants of the drive.")
@click.option("--window-s", type=float, default=15.0, show_default=True, metavar="S", help="Sightings this old count.")
@click.option("--signatures/--no-signatures", default=True, help="Whether to know landmarks by their signatures.")
@click.option("--seed", type=int, default=0, show_default=True, metavar="N")
@as_of_option
@answering
def relocalise_drive(
    vehicle: str, data: DataDirectory, truth_path: Path, as_of: int | None, *, screen: Screen, **trial: float | int
) -> Answer:
    """Find VEHICLE at random instants by what it saw shortly before, without a prior, in a map it may have no part in.

    `trigpoint drives exclude` leaves its drives out of the map first.
    """
    places, window_s, signatures = int(trial["places"]), float(trial["window_s"]), bool(trial["signatures"])
    with data.opened_log() as log:
        solved, frame = logged_map(log, as_of=as_of), logged_frame(log)
        drives = drives_of_vehicle(log, vehicle)
    paths = [path for path in read_truth(truth_path).paths if path.vehicle == vehicle]
    if not paths:
        raise InputError(f"{truth_path}: no true path of {vehicle}")
    known, watch = _known(solved, signatures=signatures), _watch(drives[0], solved, signatures=signatures)
    centre_m = known.point_m.mean(axis=0)
    anywhere = PositionPrior(point_m=centre_m, sigma_m=float(np.hypot(*(known.point_m - centre_m).T).max()))
    findings: list[Finding] = []
    with screen.counting("finding places", total=places) as advance:
        for at_ns, pose in _instants(paths[0], frame, places, window_s=window_s, seed=int(trial["seed"])):
            seen = watch.around(at_ns, window_s=window_s, merged_m=SAME_NAME_M if signatures else 0.4)
            findings.append(finding_at(relocalised(seen, known, anywhere, EXPECTED), pose, map_error_m=np.zeros(2)))
            advance(1)
    return _answer(vehicle, solved, trial_result(findings))


def _answer(vehicle: str, solved: SolvedMap, result: TrialResult) -> Answer:
    values = {
        "map_version": solved.head.map_version,
        "vehicle": vehicle,
        "places": result.places,
        "confident_share": result.confident,
        "ambiguous_share": result.ambiguous,
        "unsupported_share": result.unsupported,
        "not_found_share": result.not_found,
        "error_m": result.error_m,
        "heading_error_rad": result.heading_error_rad,
        "off_by_2_m": result.off_by_2_m,
    }
    line = (
        f"{vehicle}: {result.confident:.1%} of {result.places} instants answered with confidence, error mean "
        f"{metres(result.error_m.mean)}, p95 {metres(result.error_m.p95)}, largest {metres(result.error_m.max)}"
    )
    return Answer(values, (line,))


def _known(solved: SolvedMap, *, signatures: bool) -> Constellation:
    known = known_landmarks(solved)
    names = tuple(one.signature or one.kind for one in solved.landmarks) if signatures else known.kind
    return Constellation(
        point_m=known.point_m, covariance_m2=known.covariance_m2 + COMMON_SIGMA_M**2 * np.eye(2), kind=names
    )


def _watch(drive: Drive, solved: SolvedMap, *, signatures: bool) -> _Watch:
    """A drive's sightings of what the map has kinds, or signatures, of."""
    settings, seen, mount = SolveSettings(), drive.detections, drive.described
    calibration = nominal_calibration(drive, settings.calibration, point_scale=1.0)
    path = dead_reckon(drive, calibration, max_gap_s=settings.odometry.max_gap_s)
    base = path.at(seen.stamp_ns)
    bearing = seen.bearing_rad + mount.landmark_sensor_yaw_rad
    ahead = np.column_stack([np.cos(bearing), np.sin(bearing)])
    local_m = np.array([mount.landmark_sensor_x_m, mount.landmark_sensor_y_m]) + seen.range_m[:, None] * ahead
    turned = np.column_stack([np.cos(bearing + base[:, 2]), np.sin(bearing + base[:, 2])])
    aside = np.column_stack([-turned[:, 1], turned[:, 0]])
    along_m2 = (RANGE_SIGMA_M + RANGE_SIGMA_SHARE * seen.range_m) ** 2
    covariance_m2 = np.einsum("n,ni,nj->nij", along_m2, turned, turned)
    covariance_m2 += np.einsum("n,ni,nj->nij", (BEARING_SIGMA_RAD * seen.range_m) ** 2 + 1e-4, aside, aside)
    names = seen.signature if signatures else seen.kind
    there = (
        {one.signature or one.kind for one in solved.landmarks}
        if signatures
        else {one.kind for one in solved.landmarks}
    )
    chosen = np.array([name in there for name in names], dtype=np.bool_)
    sightings = Constellation(point_m=transform_points(base, local_m), covariance_m2=covariance_m2, kind=names)
    return _Watch(
        stamp_ns=seen.stamp_ns[chosen],
        sightings=sightings.only(chosen),
        path_stamp_ns=path.stamp_ns,
        pose=path.pose,
        distance_m=path.distance_m,
        turned_rad=path.turned_rad,
    )


def _instants(path: TruthPath, frame: MapFrame, places: int, *, window_s: float, seed: int) -> list[tuple[int, Floats]]:
    """Random instants in ns a window after a true path's start, and the true poses (3,) there."""
    pose = np.column_stack([map_points_from_wgs84(path.lat_deg, path.lon_deg, frame), path.heading_rad])
    first_ns, last_ns = int(path.stamp_ns[0]) + round(window_s * 1e9), int(path.stamp_ns[-1])
    at_ns = np.random.default_rng([seed, 41]).integers(first_ns, last_ns, size=places)
    return list(zip(at_ns.tolist(), poses_at(path.stamp_ns, pose, at_ns=at_ns), strict=True))

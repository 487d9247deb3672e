"""A campus as if it had been solved: true paths and landmarks with known errors, verdicts, anchors."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.drives import Drive, drives_of
from trigpoint.events.estimated import FixJudged, PoseFiltered
from trigpoint.events.mapped import AnchorAssociated, ImageOffsetSolved, LandmarkSolved, MapSolved, TrajectorySolved
from trigpoint.events.solved import LabelReduction, SolvedMap
from trigpoint.events.truth import Truth, TruthPath
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84
from trigpoint_evaluation.app import Evaluated, StampedPose
from trigpoint_vehicle.core.campus import Campus, simulate_campus
from trigpoint_vehicle.core.campus_settings import CampusSettings, ImuSettings, WheelSettings

Floats = NDArray[np.float64]

LANDMARK_SIGMA_M, PATH_SIGMA_M, SHIFT_M = 0.1, 0.1, (0.2, -0.1)
GATE = 5.991


@dataclass(frozen=True, slots=True, kw_only=True)
class SolvedExample:
    """A campus, and a map of it whose errors are drawn with the covariance it states."""

    campus: Campus
    truth: Truth
    evaluated: Evaluated
    anchors: tuple[AnchorLabelled, ...]
    poses: tuple[StampedPose, ...]
    reduction: LabelReduction


@cache
def small_campus(seed: int = 4) -> Campus:
    """A campus with odometry at a tenth of its rate: the pictures are the same and it is simulated sooner."""
    settings = replace(CampusSettings(), wheels=WheelSettings(rate_hz=5.0), imu=ImuSettings(rate_hz=10.0))
    return simulate_campus(seed, settings)


@cache
def solved_example(seed: int = 4) -> SolvedExample:
    """The campus of a seed as if solved, with draws of the same seed."""
    campus, rng = small_campus(seed), np.random.default_rng(seed)
    drives = drives_of(row for recording in campus.recordings for row in recording.rows)
    landmarks = _landmarks(campus, rng)
    trajectories = tuple(_trajectory(path, campus.frame, drives, rng) for path in campus.truth.paths)
    tied = _associations(campus, landmarks)
    images = tuple(
        ImageOffsetSolved(map_version=1, image=name, offset_m=offset_m, covariance_m2=0.15**2 * np.eye(2))
        for name, offset_m in zip(campus.imagery.image, campus.imagery.offset_m, strict=True)
    )
    head = MapSolved(
        map_version=1,
        method="anchored",
        settings_json='{"method": "anchored", "fixes": {"sigma_m": 0.5, "bias_sigma_m": 2.5}}',
        inputs=tuple((f"veh-{drive.vehicle}", 1000) for drive in drives),
        landmark_count=len(landmarks),
        anchor_count=len(campus.anchors),
        wall_s=12.5,
    )
    solved = SolvedMap(head=head, trajectories=trajectories, landmarks=landmarks, anchors=tied, images=images)
    verdicts = tuple(verdict for drive in drives for verdict in _verdicts(drive, campus, rng))
    return SolvedExample(
        campus=campus,
        truth=campus.truth,
        evaluated=Evaluated(solved=solved, frame=campus.frame, drives=drives, verdicts=verdicts),
        anchors=campus.anchors,
        poses=tuple(pose for one in trajectories for pose in _filtered(one, rng)),
        reduction=_reduction(campus),
    )


def _landmarks(campus: Campus, rng: np.random.Generator) -> tuple[LandmarkSolved, ...]:
    error_m = rng.normal(0.0, LANDMARK_SIGMA_M, campus.landmarks.position_m.shape)
    position_m = campus.landmarks.position_m + np.array(SHIFT_M) + error_m
    return tuple(
        LandmarkSolved(
            map_version=1,
            landmark=f"L{index:04d}",
            kind=kind,
            signature="",
            position_m=point_m,
            covariance_m2=LANDMARK_SIGMA_M**2 * np.eye(2),
            observation_count=20,
            vehicles=("vehicle-1",),
            first_seen_ns=0,
            last_seen_ns=1,
            anchors=(),
            observations=(),
        )
        for index, (kind, point_m) in enumerate(zip(campus.landmarks.kind, position_m, strict=True))
    )


def _trajectory(
    path: TruthPath, frame: MapFrame, drives: tuple[Drive, ...], rng: np.random.Generator
) -> TrajectorySolved:
    every = slice(None, None, 4)
    point_m = map_points_from_wgs84(path.lat_deg[every], path.lon_deg[every], frame)
    (drive,) = [drive for drive in drives if drive.vehicle == path.vehicle]
    error_m = rng.normal(0.0, PATH_SIGMA_M, point_m.shape)
    return TrajectorySolved(
        map_version=1,
        vehicle=path.vehicle,
        boot_id=drive.boot_id,
        stamp_ns=path.stamp_ns[every],
        pose=np.column_stack([point_m + error_m, path.heading_rad[every]]),
        covariance=np.tile(PATH_SIGMA_M**2 * np.eye(3), (len(point_m), 1, 1)),
        calibration=(
            ("speed_scale", 1.0123, 0.0005),
            ("antenna_x_m", drive.described.antenna_x_m, 0.02),
            ("antenna_y_m", drive.described.antenna_y_m, 0.02),
        ),
    )


def _filtered(trajectory: TrajectorySolved, rng: np.random.Generator) -> list[StampedPose]:
    wander_m = np.cumsum(rng.normal(0.0, 0.05, (len(trajectory.stamp_ns), 2)), axis=0)
    return [
        StampedPose(
            stamp_ns=int(stamp_ns),
            pose=PoseFiltered(
                vehicle=trajectory.vehicle,
                boot_id=trajectory.boot_id,
                x_m=float(pose[0] + off[0]),
                y_m=float(pose[1] + off[1]),
                heading_rad=float(pose[2]),
                speed_mps=6.0,
                covariance=np.eye(3),
            ),
        )
        for stamp_ns, pose, off in zip(trajectory.stamp_ns, trajectory.pose, wander_m, strict=True)
    ]


def _verdicts(drive: Drive, campus: Campus, rng: np.random.Generator) -> list[FixJudged]:
    """Clear fixes are accepted but for the 5 % beyond the gate, all others rejected."""
    (true,) = [fixes for fixes in campus.truth.fixes if fixes.vehicle == drive.vehicle]
    nis = np.where(np.array(true.state) == "clear", rng.chisquare(2, len(true.state)), rng.uniform(20.0, 1e4))
    return [
        FixJudged(
            vehicle=drive.vehicle,
            boot_id=drive.boot_id,
            fix_sequence=int(sequence),
            accepted=bool(value <= GATE),
            reason="inside gate" if value <= GATE else "outside gate",
            nis=float(value),
            limit=GATE,
            innovation_x_m=1.0,
            innovation_y_m=1.0,
        )
        for sequence, value in zip(drive.fixes.sequence, nis, strict=True)
    ]


def _associations(campus: Campus, landmarks: tuple[LandmarkSolved, ...]) -> tuple[AnchorAssociated, ...]:
    numbers = {name: index for index, name in enumerate(campus.landmarks.name)}
    tied = []
    for count, (label, anchor) in enumerate(zip(campus.truth.labels, campus.anchors, strict=True)):
        index = numbers[label.landmark]
        offset_m = campus.imagery.offset_m[campus.imagery.image.index(anchor.image)]
        label_m = map_points_from_wgs84(np.array([anchor.lat_deg]), np.array([anchor.lon_deg]), campus.frame)[0]
        found = count != 7  # one anchor stays untied
        tied.append(
            AnchorAssociated(
                map_version=1,
                anchor=anchor.anchor,
                landmark=landmarks[index].landmark if found else "",
                reason="mutual nearest" if found else "two landmarks within 1.5 m",
                residual_m=label_m - campus.landmarks.position_m[index] - offset_m,
            )
        )
    return tuple(tied)


def _reduction(campus: Campus) -> LabelReduction:
    """The labels over a map whose error is smooth over 150 m, sigma 1.3 m an axis, with no label tied."""
    rng = np.random.default_rng(1)
    numbers = {name: index for index, name in enumerate(campus.landmarks.name)}
    index = np.array([numbers[label.landmark] for label in campus.truth.labels])
    point_m = campus.landmarks.position_m[index]
    away_m = np.linalg.norm(point_m[:, None] - point_m[None], axis=2)
    kernel = np.kron(1.3**2 * np.exp(-((away_m / 150.0) ** 2)) + 0.05**2 * np.eye(len(index)), np.eye(2))
    error_m = rng.multivariate_normal(np.zeros(len(kernel)), kernel).reshape(-1, 2)
    lat_deg, lon_deg = (np.array([getattr(one, name) for one in campus.anchors]) for name in ("lat_deg", "lon_deg"))
    return LabelReduction(
        landmarks=tuple(campus.landmarks.name[one] for one in index),
        point_m=point_m + error_m,
        information=np.linalg.inv(kernel),
        gradient=np.zeros(len(kernel)),
        labels=tuple(one.anchor for one in campus.anchors),
        landmark_index=np.arange(len(index)),
        label_m=map_points_from_wgs84(lat_deg, lon_deg, campus.frame),
        sigma_m=np.full(len(index), 0.1),
        image_index=np.array([campus.imagery.image.index(one.image) for one in campus.anchors]),
        images=campus.imagery.image,
        image_sigma_m=np.full(len(campus.imagery.image), 0.35),
    )

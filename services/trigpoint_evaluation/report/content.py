"""What the report shows, gathered before anything is drawn."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.mapped import TrajectorySolved
from trigpoint.events.observed import EventRefused
from trigpoint.geodesy.projection import map_points_from_wgs84
from trigpoint_evaluation.app import Evaluated, StampedPose, TruthEvaluation
from trigpoint_evaluation.core.consistency import JudgedFixes, judged_fixes
from trigpoint_evaluation.core.draws import LeaveOutResult
from trigpoint_evaluation.core.paths import path_length_m

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

NOT_RECORDED = ""  # the image of an association written before images were named there


@dataclass(frozen=True, slots=True, kw_only=True)
class UntiedResiduals:
    """Label minus landmark (n, 2) in m as the map stood before any anchor was tied."""

    labels: tuple[str, ...]
    residual_m: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaveOutCurves:
    """Held-out error over the number of tied anchors: over all images, held out in blocks, and in `image` alone."""

    everywhere: tuple[LeaveOutResult, ...]
    blocked: tuple[LeaveOutResult, ...]
    image: str
    within_image: tuple[LeaveOutResult, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportContent:
    """Everything on the page. `untied`, `curves` and `truth` are None where they are not known."""

    evaluated: Evaluated
    anchors: tuple[AnchorLabelled, ...]
    poses: tuple[StampedPose, ...]
    refusals: tuple[EventRefused, ...]
    versions: tuple[tuple[str, str], ...]
    untied: UntiedResiduals | None = None
    curves: LeaveOutCurves | None = None
    truth: TruthEvaluation | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivePicture:
    """One drive in the map frame: fixes (f, 2) with their verdicts, filtered path (p, 2), solved path or None."""

    vehicle: str
    boot_id: str
    fix_m: Floats
    accepted: Flags
    judged: JudgedFixes
    filtered_m: Floats
    solved: TrajectorySolved | None
    duration_s: float

    @property
    def length_m(self) -> float:
        """Length of the solved path, 0 without one."""
        return 0.0 if self.solved is None else path_length_m(self.solved.pose)


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchorPicture:
    """One anchor in the map frame: label (2,), and where it is tied: its landmark (2,) and residual (2,) in m."""

    anchor: AnchorLabelled
    label_m: Floats
    landmark_m: Floats | None
    residual_m: Floats | None
    reason: str


def drive_pictures(content: ReportContent) -> tuple[DrivePicture, ...]:
    """Every drive in the map frame."""
    evaluated = content.evaluated
    solved = {(one.vehicle, one.boot_id): one for one in evaluated.solved.trajectories}
    filtered = filtered_paths(content.poses)
    pictures = []
    for drive in evaluated.drives:
        judged = judged_fixes(drive, evaluated.verdicts)
        accepted = np.isin(drive.fixes.stamp_ns, judged.stamp_ns[judged.accepted])
        stamps = (drive.wheels.stamp_ns, drive.imu.stamp_ns, drive.fixes.stamp_ns, drive.detections.stamp_ns)
        known = [column for column in stamps if len(column)]
        span_ns = max(int(column[-1]) for column in known) - min(int(column[0]) for column in known) if known else 0
        pictures.append(
            DrivePicture(
                vehicle=drive.vehicle,
                boot_id=drive.boot_id,
                fix_m=map_points_from_wgs84(drive.fixes.lat_deg, drive.fixes.lon_deg, evaluated.frame),
                accepted=accepted,
                judged=judged,
                filtered_m=filtered.get((drive.vehicle, drive.boot_id), np.zeros((0, 2))),
                solved=solved.get((drive.vehicle, drive.boot_id)),
                duration_s=span_ns * 1e-9,
            )
        )
    return tuple(pictures)


def filtered_paths(poses: Sequence[StampedPose]) -> dict[tuple[str, str], Floats]:
    """Filtered positions (n, 2) in m of each (vehicle, boot), in order of time."""
    by_drive: dict[tuple[str, str], list[StampedPose]] = {}
    for one in poses:
        by_drive.setdefault((one.pose.vehicle, one.pose.boot_id), []).append(one)
    return {
        name: np.array([[one.pose.x_m, one.pose.y_m] for one in sorted(rows, key=lambda row: row.stamp_ns)])
        for name, rows in by_drive.items()
    }


def anchor_pictures(content: ReportContent) -> tuple[AnchorPicture, ...]:
    """Every anchor in the map frame, with what became of it."""
    solved, anchors = content.evaluated.solved, content.anchors
    if not anchors:
        return ()
    lat_deg, lon_deg = np.array([one.lat_deg for one in anchors]), np.array([one.lon_deg for one in anchors])
    label_m = map_points_from_wgs84(lat_deg, lon_deg, content.evaluated.frame)
    associated = {(one.anchor, one.image): one for one in solved.anchors}
    landmark_m = {one.landmark: one.position_m for one in solved.landmarks}
    pictures = []
    for anchor, point_m in zip(anchors, label_m, strict=True):
        found = associated.get((anchor.anchor, anchor.image), associated.get((anchor.anchor, NOT_RECORDED)))
        tied = found is not None and bool(found.landmark)
        pictures.append(
            AnchorPicture(
                anchor=anchor,
                label_m=point_m,
                landmark_m=landmark_m.get(found.landmark) if found is not None and tied else None,
                residual_m=found.residual_m if found is not None and tied else None,
                reason="not looked at" if found is None else found.reason,
            )
        )
    return tuple(pictures)


def refusal_counts(refusals: Sequence[EventRefused]) -> tuple[tuple[str, str, int, str], ...]:
    """Of each source and reason: how many messages were refused, and the first one's detail."""
    counts = Counter((one.source, one.reason) for one in refusals)
    first = {(one.source, one.reason): one.detail for one in reversed(refusals)}
    return tuple((*name, count, first[name]) for name, count in sorted(counts.items()))

"""A solved map as events, and as the Gaussian its labels can be tied to."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b

import gtsam
import numpy as np
from numpy.typing import NDArray

from trigpoint.anchoring.gain import label_terms
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.drives import Drive
from trigpoint.events.estimated import FixJudged
from trigpoint.events.mapped import (
    AnchorAssociated,
    ImageOffsetSolved,
    LabelGainSolved,
    LandmarkSolved,
    MapSolved,
    TrajectorySolved,
)
from trigpoint.events.solved import LabelReduction, SolvedMap
from trigpoint.geodesy.projection import MapFrame
from trigpoint_optimisation.core.anchoring import residuals_m
from trigpoint_optimisation.core.fleet import Progress
from trigpoint_optimisation.core.fleet_placing import LeftOut
from trigpoint_optimisation.core.marginals import covariance_of, pose_covariances, vector_sigmas
from trigpoint_optimisation.core.odometry import TurnSource, turn_source
from trigpoint_optimisation.core.preparation import PreparedDrive
from trigpoint_optimisation.core.stages import (
    Solved,
    full_graph,
    in_silence,
    landmark_signatures,
    reduced_landmarks,
    solve_fleet,
)
from trigpoint_optimisation.core.state import (
    DriveState,
    antenna_key,
    pose_key,
    scale_key,
    sensor_key,
    turn_bias_key,
    values_of,
)
from trigpoint_optimisation.core.trajectory import output_stamps, poses_at
from trigpoint_optimisation.settings import SolveSettings, settings_json

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

TRAJECTORY_STEP_S = 0.5
COVARIANCE_POSES = 150  # per drive; between them covariances are interpolated
CAMERA_CALIBRATION = (  # the states of `sighting_factor`, in their order
    "camera_ln_range",
    "camera_ln_range_per_rad",
    "camera_ln_range_per_rad2",
    "camera_ahead_m",
    "camera_bearing_rad",
    "camera_bearing_scale",
)
BELIEVED_SHARE = 0.7  # of a drive's fixes must stand uncontradicted, else the filter has probably lost its way
CONTRADICTED = "outside gate"  # the verdict's reason for a fix that a filter sure of its position rejected
UNNUMBERED = 0  # a map version until the log gives it its number


@dataclass(frozen=True, kw_only=True)
class Solution:
    """A solved fleet with what follows from it; its events carry no version number yet."""

    solved: Solved

    @cached_property
    def joint_covariance_m2(self) -> Floats:
        """Joint covariance (2l + 2k, 2l + 2k) of all landmarks, in order of `map.landmarks`, and image offsets: x and y
        of each in turn."""
        return covariance_of(reduced_landmarks(self.solved))

    @property
    def landmark_covariance_m2(self) -> Floats:
        """Joint covariance (2l, 2l) of all landmarks alone."""
        count = 2 * self.solved.association.landmark_count
        return self.joint_covariance_m2[:count, :count]

    @cached_property
    def map(self) -> SolvedMap:
        """The map as events of version UNNUMBERED, without wall time and inputs."""
        return _solved_map(self.solved, joint_covariance_m2=self.joint_covariance_m2)

    @property
    def left_out(self) -> tuple[LeftOut, ...]:
        """The drives that could not be placed, and why."""
        return self.solved.left_out

    def reduction(self) -> LabelReduction:
        """Everything but the labels marginalised onto the labelled landmarks, at the solution."""
        return _label_reduction(self.solved)


def solve_map(
    drives: Sequence[Drive],
    anchors: Sequence[AnchorLabelled],
    frame: MapFrame,
    settings: SolveSettings,
    *,
    verdicts: Sequence[FixJudged] | None = None,
    progress: Progress = in_silence,
) -> Solution:
    """The map of all drives by the settings' method; with `verdicts`, no fix that the filter contradicts takes
    part, unless edges are close.

    Raises AlignmentRefused when the data leave a drive's place undetermined.
    """
    if settings.chosen_edges == "close":  # these follow the receiver, also where it goes astray
        verdicts = None
    allowed = None if verdicts is None else [usable_fixes(drive, verdicts) for drive in drives]
    return Solution(solved=solve_fleet(drives, anchors, frame, settings, allowed=allowed, progress=progress))


def usable_fixes(drive: Drive, verdicts: Sequence[FixJudged]) -> Bools:
    """Which of a drive's fixes (f,) the filter does not contradict; all of them where it contradicts so many that it
    has lost its way itself.

    Fixes it only waited out, before it had a position or while it made sure of one after an outage, are left to the
    solve: that sees what came after them too.
    """
    if turn_source(drive) is TurnSource.SAMPLED_WHEELS:  # too weak to judge fixes one by one: the robust path does
        return np.ones(len(drive.fixes.stamp_ns), dtype=bool)
    contradicted = {
        verdict.fix_sequence
        for verdict in verdicts
        if (verdict.vehicle, verdict.boot_id, verdict.reason) == (drive.vehicle, drive.boot_id, CONTRADICTED)
    }
    usable = np.array([int(sequence) not in contradicted for sequence in drive.fixes.sequence], dtype=bool)
    return usable if not len(usable) or usable.mean() >= BELIEVED_SHARE else np.ones_like(usable)


def _solved_map(solved: Solved, *, joint_covariance_m2: Floats) -> SolvedMap:
    landmarks = _landmarks(solved, joint_covariance_m2)
    anchors = _anchors(solved, tuple(landmark.landmark for landmark in landmarks))
    head = MapSolved(
        map_version=UNNUMBERED,
        method=solved.fleet.settings.method,
        settings_json=settings_json(solved.fleet.settings),
        inputs=(),
        landmark_count=len(landmarks),
        anchor_count=sum(1 for anchor in anchors if anchor.landmark),
        wall_s=0.0,
    )
    return SolvedMap(
        head=head,
        trajectories=_trajectories(solved),
        landmarks=landmarks,
        anchors=anchors,
        images=_images(solved, joint_covariance_m2),
        gains=_gains(solved, joint_covariance_m2, tuple(landmark.landmark for landmark in landmarks)),
    )


def _calibration_sigmas(each: PreparedDrive, drive: DriveState, marginals: gtsam.Marginals) -> Floats:
    """1-sigma (6,) or, of a camera, (12,) in the order of `_calibration`: scales and delay, middle bias, antenna."""
    d, middle = each.index, len(drive.turn_bias) // 2
    keys = [scale_key(d), turn_bias_key(d, middle), antenna_key(d), *([sensor_key(d)] if each.camera else [])]
    return np.concatenate(vector_sigmas(marginals, keys))


def _calibration(each: PreparedDrive, drive: DriveState, sigma: Floats) -> tuple[tuple[str, float, float], ...]:
    """Name, value and 1-sigma of each calibration state; the turn bias is the one in the middle of the drive."""
    bias_name = {
        TurnSource.IMU: "turn_bias_radps",
        TurnSource.STEERING: "turn_bias_rad",
    }.get(each.source, "turn_bias_radpm")
    names = ["speed_scale", "turn_scale", "wheel_delay_s", bias_name, "antenna_x_m", "antenna_y_m"]
    bias = drive.turn_bias[len(drive.turn_bias) // 2]
    values = [*drive.scale.tolist(), float(bias), *drive.antenna_m.tolist()]
    if each.camera:
        names += CAMERA_CALIBRATION
        values += drive.sensor.tolist()
    return tuple(zip(names, values, sigma.tolist(), strict=True))


def _trajectories(solved: Solved) -> tuple[TrajectorySolved, ...]:
    values = values_of(solved.state)
    marginals = gtsam.Marginals(full_graph(solved), values)
    return tuple(
        _trajectory(each, drive, marginals, values)
        for each, drive in zip(solved.fleet.prepared, solved.state.drives, strict=True)
    )


def _spread(count: int, most: int) -> Ints:
    """At most `most` indices spread over 0 … count - 1, both ends included."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def _trajectory(
    each: PreparedDrive, drive: DriveState, marginals: gtsam.Marginals, values: gtsam.Values
) -> TrajectorySolved:
    rows = _spread(len(drive.pose), COVARIANCE_POSES)
    at_ns, stamp_ns = each.stamp_ns[rows], output_stamps(each, step_s=TRAJECTORY_STEP_S)
    covariance = pose_covariances(marginals, values, [pose_key(each.index, int(k)) for k in rows])
    start_ns = int(at_ns[0])
    known_s, wanted_s = (at_ns - start_ns) * 1e-9, (stamp_ns - start_ns) * 1e-9
    flat = covariance.reshape(len(at_ns), 9)
    between = np.column_stack([np.interp(wanted_s, known_s, flat[:, entry]) for entry in range(9)])
    return TrajectorySolved(
        map_version=UNNUMBERED,
        vehicle=each.drive.vehicle,
        boot_id=each.drive.boot_id,
        stamp_ns=stamp_ns,
        pose=poses_at(each, drive.pose, stamp_ns),
        covariance=between.reshape(-1, 3, 3),
        calibration=_calibration(each, drive, _calibration_sigmas(each, drive, marginals)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sighted:
    """All detections (n,) that are of a landmark: which drive, which row of it, which landmark, when."""

    drive: Ints
    row: Ints
    landmark: Ints
    stamp_ns: Ints


def _sighted(solved: Solved) -> _Sighted:
    """The associated detections in order of landmark, time and drive."""
    parts = []
    for index, (each, track) in enumerate(zip(solved.fleet.prepared, solved.association.track, strict=True)):
        row = np.nonzero(track >= 0)[0]
        landmark = solved.association.landmark_of_track[track[row]]
        parts.append(np.column_stack([np.full(len(row), index), row, landmark, each.drive.detections.stamp_ns[row]]))
    table = np.concatenate(parts).astype(np.int64)
    table = table[np.lexsort((table[:, 0], table[:, 3], table[:, 2]))]
    return _Sighted(drive=table[:, 0], row=table[:, 1], landmark=table[:, 2], stamp_ns=table[:, 3])


def _landmarks(solved: Solved, covariance: Floats) -> tuple[LandmarkSolved, ...]:
    sighted, signatures = _sighted(solved), landmark_signatures(solved)
    bounds = np.searchsorted(sighted.landmark, np.arange(solved.association.landmark_count + 1))
    tied = _tied_names(solved)
    return tuple(
        _landmark(solved, sighted, slice(bounds[j], bounds[j + 1]), signatures[j], covariance, tied.get(j, ()))
        for j in range(solved.association.landmark_count)
    )


def _tied_names(solved: Solved) -> dict[int, tuple[str, ...]]:
    tied: dict[int, tuple[str, ...]] = {}
    for name, landmark in zip(solved.labels.name, solved.assignment.landmark, strict=True):
        if landmark >= 0:
            tied[int(landmark)] = (*tied.get(int(landmark), ()), name)
    return tied


def _landmark(
    solved: Solved, sighted: _Sighted, own: slice, signature: str, covariance: Floats, anchors: tuple[str, ...]
) -> LandmarkSolved:
    j = int(sighted.landmark[own.start])
    drives = [solved.fleet.prepared[d].drive for d in sighted.drive[own]]
    rows = sighted.row[own]
    observations = tuple(
        dict.fromkeys(
            (drive.vehicle, drive.boot_id, int(drive.detections.sequence[row]))
            for drive, row in zip(drives, rows, strict=True)
        )
    )
    track = int(solved.association.track[int(sighted.drive[own.start])][rows[0]])
    return LandmarkSolved(
        map_version=UNNUMBERED,
        landmark=signature or _stable_name(drives[0], int(rows[0])),
        kind=solved.association.kinds[int(solved.association.kind_of_track[track])],
        signature=signature,
        position_m=solved.state.landmark_m[j],
        covariance_m2=covariance[2 * j : 2 * j + 2, 2 * j : 2 * j + 2],
        observation_count=len(rows),
        vehicles=tuple(sorted({drive.vehicle for drive in drives})),
        first_seen_ns=int(sighted.stamp_ns[own.start]),
        last_seen_ns=int(sighted.stamp_ns[own.stop - 1]),
        anchors=anchors,
        observations=observations,
    )


def _stable_name(drive: Drive, row: int) -> str:
    """A landmark's name by its first detection: the same in every version that starts from it."""
    first = np.searchsorted(drive.detections.stamp_ns, drive.detections.stamp_ns[row])
    text = f"{drive.vehicle}/{drive.boot_id}/{int(drive.detections.sequence[row])}/{row - int(first)}"
    return "lm-" + blake2b(text.encode(), digest_size=6).hexdigest()


def _anchors(solved: Solved, landmark: Sequence[str]) -> tuple[AnchorAssociated, ...]:
    state, labels, assignment = solved.state, solved.labels, solved.assignment
    residual = residuals_m(labels, assignment, state.landmark_m, state.image_m)
    return tuple(
        AnchorAssociated(
            map_version=UNNUMBERED,
            anchor=name,
            landmark=landmark[found] if found >= 0 else "",
            reason=assignment.reason[row],
            residual_m=residual[row],
            image=labels.labelled_in[row],
        )
        for row, (name, found) in enumerate(zip(labels.name, assignment.landmark, strict=True))
    )


def _images(solved: Solved, joint_covariance_m2: Floats) -> tuple[ImageOffsetSolved, ...]:
    count = 2 * solved.association.landmark_count
    covariance = joint_covariance_m2[count:, count:]
    return tuple(
        ImageOffsetSolved(
            map_version=UNNUMBERED,
            image=name,
            offset_m=solved.state.image_m[i],
            covariance_m2=covariance[2 * i : 2 * i + 2, 2 * i : 2 * i + 2],
        )
        for i, name in enumerate(solved.labels.images)
    )


def _gains(solved: Solved, joint_covariance_m2: Floats, names: tuple[str, ...]) -> tuple[LabelGainSolved, ...]:
    """What one more label would tell: in none of the images, then in each of them."""
    found = []
    for number, image in ((None, ""), *enumerate(solved.labels.images)):
        expected_m2, shared_m4 = label_terms(joint_covariance_m2, landmark_count=len(names), image=number)
        gain = LabelGainSolved(
            map_version=UNNUMBERED, image=image, landmarks=names, expected_m2=expected_m2, shared_m4=shared_m4
        )
        found.append(gain)
    return tuple(found)


def _label_reduction(solved: Solved) -> LabelReduction:
    labels, assignment = solved.labels, solved.assignment
    rows = np.nonzero(assignment.landmark >= 0)[0]
    numbers, index = np.unique(assignment.landmark[rows], return_inverse=True)
    reduced = reduced_landmarks(solved, kept=numbers, with_labels=False)
    return LabelReduction(
        landmarks=tuple(str(number) for number in numbers),
        point_m=solved.state.landmark_m[numbers],
        information=reduced.information,
        gradient=reduced.gradient,
        labels=tuple(labels.name[row] for row in rows),
        landmark_index=index.astype(np.int64),
        label_m=labels.label_m[rows],
        sigma_m=labels.sigma_m[rows],
        image_index=labels.image[rows],
        images=labels.images,
        image_sigma_m=labels.image_sigma_m,
    )

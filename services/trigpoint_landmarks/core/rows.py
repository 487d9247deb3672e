"""A map version's events as rows of the database: positions in grid and WGS84, ellipses, validity."""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from hashlib import blake2b
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.corrected import AnchorLabelled, Corrected, anchors_in_force
from trigpoint.events.envelope import LogPosition
from trigpoint.events.mapped import AnchorAssociated, ImageOffsetSolved, LabelGainSolved, TrajectorySolved
from trigpoint.events.solved_landmarks import Observations, SolvedLandmarks
from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.projection import MapFrame, map_from_wgs84, wgs84_from_map_points
from trigpoint.geodesy.uncertainty import ellipses_of
from trigpoint.landmarks.model import (
    Anchor,
    ImageOffset,
    LabelGain,
    Landmark,
    MapChange,
    MapVersion,
    Trajectory,
    provenance_json,
)
from trigpoint_landmarks.core.versions import SolvedVersion

Floats = NDArray[np.float64]
UNSEEN = provenance_json({})
HELD_LENGTH = 128  # characters of provenance that are kept as they are
Labels = Mapping[tuple[str, str], AnchorLabelled]  # by name and image


def labels_within(
    corrected: Iterable[tuple[LogPosition, Corrected]], inputs: Sequence[tuple[str, int]]
) -> dict[tuple[str, str], AnchorLabelled]:
    """The label in force of each anchor, by name and image, among a version's inputs (stream, count): what its solve
    could know.

    A label added, mended or retracted later says nothing about an earlier version, however late that is projected.
    """
    counts = dict(inputs)
    known = (correction for position, correction in corrected if position.number < counts.get(position.stream, 0))
    return {(label.anchor, label.image): label for label in anchors_in_force(known)}


def map_change(version: SolvedVersion, *, frame: MapFrame, labels: Labels, valid: Mapping[str, Landmark]) -> MapChange:
    """What a version changes in a map whose valid landmarks are `valid`, by id, as `held` has them.

    A landmark solved exactly as before keeps its row; any other is closed, and opened anew if it is still there. Of a
    version that is a change of the one before, landmarks it does not name keep theirs too.
    """
    removed = frozenset(version.solved.removed) if version.solved.base_version else frozenset()
    rows = landmark_rows(_without(version.landmarks, removed), frame)
    solved = {row.landmark: row for row in rows}
    kept = {name for name, row in solved.items() if name in valid and _is_same(valid[name], row)}
    gone: Iterable[str] = (*solved, *removed) if version.solved.base_version else valid
    return MapChange(
        version=_version_row(version, frame),
        opened=tuple(row for name, row in solved.items() if name not in kept),
        closed=tuple(name for name in gone if name in valid and name not in kept),
        trajectories=tuple(_trajectory_row(row, frame) for row in version.trajectories),
        anchors=tuple(_anchor_row(row, _label_of(row, labels), frame) for row in version.anchors),
        image_offsets=tuple(_offset_row(row) for row in version.image_offsets),
        label_gains=tuple(_gain_row(row) for row in version.label_gains),
    )


def make_valid(valid: dict[str, Landmark], change: MapChange) -> None:
    """`valid`, the valid landmarks by id, as they are once the change is made: in place, for there are many."""
    for name in change.closed:
        del valid[name]
    for row in change.opened:
        valid[row.landmark] = held(row)


def held(row: Landmark) -> Landmark:
    """A row as it is kept in memory: a fingerprint in place of what saw it, which grows for ever, once it is long."""
    if len(row.provenance) <= HELD_LENGTH:
        return row
    return row._replace(provenance=blake2b(row.provenance.encode(), digest_size=16).hexdigest())


def landmark_rows(solved: SolvedLandmarks, frame: MapFrame) -> list[Landmark]:
    """The landmarks as rows valid from their version on."""
    if not len(solved):
        return []
    points_m, covariances_m2 = solved.positions_m, solved.covariances_m2
    grid_m = points_m + np.array([frame.origin_easting_m, frame.origin_northing_m])
    placed = [points_m, grid_m, *wgs84_from_map_points(points_m, frame)]
    variances_m2 = covariances_m2.reshape(-1, 4)[:, [0, 1, 3]]
    columns = np.column_stack([*placed, variances_m2, ellipses_of(covariances_m2)]).T.tolist()
    rows = zip(
        solved.landmarks,
        solved.kinds,
        solved.signatures,
        *columns,
        solved.observation_counts.tolist(),
        solved.vehicles,
        solved.first_seen_ns.tolist(),
        solved.last_seen_ns.tolist(),
        map(bool, solved.anchors),
        solved.anchors,
        _provenances(solved.observations),
        solved.map_versions.tolist(),
        repeat(None),
        strict=False,
    )
    return list(map(Landmark._make, rows))


def _without(solved: SolvedLandmarks, removed: frozenset[str]) -> SolvedLandmarks:
    if removed.isdisjoint(solved.landmarks):
        return solved
    return solved.picked(np.flatnonzero([name not in removed for name in solved.landmarks]))


def _provenances(observations: Sequence[Observations]) -> Iterator[str]:
    """The text of each landmark's observations; made once of those that are one and the same."""
    distinct = {id(one): one for one in observations}
    texts = {number: provenance_json(one) for number, one in distinct.items()}
    return (texts[id(one)] for one in observations)


def _is_same(known: Landmark, solved: Landmark) -> bool:
    """Whether a row says what one that is held says; a version upon another may have seen nothing more of it."""
    if known.x_m != solved.x_m or known.y_m != solved.y_m:
        return False  # hardly ever are all others compared
    is_unseen_since = solved.provenance == UNSEEN
    return known.says_the_same_as(solved._replace(provenance=known.provenance) if is_unseen_since else held(solved))


def _version_row(version: SolvedVersion, frame: MapFrame) -> MapVersion:
    solved = version.solved
    return MapVersion(
        map_version=solved.map_version,
        base_version=solved.base_version,
        method=solved.method,
        settings_json=solved.settings_json,
        inputs_json=json.dumps(solved.inputs),
        landmark_count=solved.landmark_count,
        anchor_count=solved.anchor_count,
        wall_s=solved.wall_s,
        solved_ns=version.stamp_ns,
        log_stream=version.position.stream,
        log_number=version.position.number,
        crs=frame.crs,
        origin_easting_m=frame.origin_easting_m,
        origin_northing_m=frame.origin_northing_m,
        operation=frame.operation,
        operation_accuracy_m=frame.operation_accuracy_m,
    )


def _trajectory_row(row: TrajectorySolved, frame: MapFrame) -> Trajectory:
    points_m = np.asarray(row.pose, dtype=np.float64).reshape(-1, 3)[:, :2]
    grid_m = points_m + np.array([frame.origin_easting_m, frame.origin_northing_m])
    return Trajectory(
        map_version=row.map_version,
        vehicle=row.vehicle,
        boot_id=row.boot_id,
        first_stamp_ns=int(row.stamp_ns[0]) if len(row.stamp_ns) else 0,
        last_stamp_ns=int(row.stamp_ns[-1]) if len(row.stamp_ns) else 0,
        pose_count=len(points_m),
        length_m=float(np.hypot(*np.diff(points_m, axis=0).T).sum()),
        calibration_json=json.dumps([(name, _finite(value), _finite(sigma)) for name, value, sigma in row.calibration]),
        path=tuple((easting_m, northing_m) for easting_m, northing_m in grid_m.tolist()),
    )


def _label_of(row: AnchorAssociated, labels: Labels) -> AnchorLabelled | None:
    """The anchor's label; of an association that names no image and is of no survey, the last of its name."""
    named = [label for (anchor, _), label in labels.items() if anchor == row.anchor] if not row.image else []
    return labels.get((row.anchor, row.image), named[-1] if named else None)


def _anchor_row(row: AnchorAssociated, label: AnchorLabelled | None, frame: MapFrame) -> Anchor:
    x_m, y_m = float(row.residual_m[0]), float(row.residual_m[1])
    placed = None if label is None else map_from_wgs84(Wgs84Position(label.lat_deg, label.lon_deg), frame)
    return Anchor(
        map_version=row.map_version,
        anchor=row.anchor,
        image=label.image if label else row.image,
        kind=label.kind if label else "",
        signature=label.signature if label else "",
        landmark=row.landmark,
        reason=row.reason,
        sigma_m=_finite(label.sigma_m) if label else None,
        residual_x_m=_finite(x_m),
        residual_y_m=_finite(y_m),
        residual_m=_finite(math.hypot(x_m, y_m)),
        lat_deg=label.lat_deg if label else None,
        lon_deg=label.lon_deg if label else None,
        easting_m=placed.x_m + frame.origin_easting_m if placed else None,
        northing_m=placed.y_m + frame.origin_northing_m if placed else None,
    )


def _offset_row(row: ImageOffsetSolved) -> ImageOffset:
    return ImageOffset(
        map_version=row.map_version,
        image=row.image,
        offset_x_m=float(row.offset_m[0]),
        offset_y_m=float(row.offset_m[1]),
        variance_x_m2=float(row.covariance_m2[0, 0]),
        covariance_xy_m2=float(row.covariance_m2[0, 1]),
        variance_y_m2=float(row.covariance_m2[1, 1]),
    )


def _gain_row(row: LabelGainSolved) -> LabelGain:
    """The gain of labels as a row; a landmark whose terms are not finite numbers says nothing."""
    terms = np.column_stack([row.expected_m2, row.shared_m4])
    finite = np.flatnonzero(np.isfinite(terms).all(axis=1))
    return LabelGain(
        map_version=row.map_version,
        image=row.image,
        landmarks_json=json.dumps([row.landmarks[number] for number in finite], ensure_ascii=False),
        terms_json=json.dumps(terms[finite].tolist()),
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None

"""Detections become landmarks: tracks within a pass, joined over passes and vehicles, and joined anew after a solve."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint_optimisation.core.detection_noise import DetectionNoise, measured_noise
from trigpoint_optimisation.core.fleet import Fleet, detections_in_map
from trigpoint_optimisation.core.merging import LandmarkGroups, Tracks, voted_pairs
from trigpoint_optimisation.core.preparation import PreparedDrive
from trigpoint_optimisation.core.sightings import (
    Averaging,
    Sightings,
    drive_sightings,
    joined,
    keyframe_points,
    perceived_covariances,
)
from trigpoint_optimisation.core.single_sightings import (
    VEHICLE,
    Seeing,
    SingleSightings,
    sensor_poses,
    single_sightings,
)
from trigpoint_optimisation.core.state import MapState
from trigpoint_optimisation.core.tracklets import close_pairs, linked_tracks, seen_together
from trigpoint_optimisation.settings import DetectionSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SAME_PASS_M = 60.0  # tracks of one drive this close along the path may be one track that broke
SAME_PASS_GATE_M = 0.5
JOINING_ROUNDS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Association:
    """Which landmark each detection is of. track (d,) per drive, negative where none; landmark_of_track (t,);
    `kind_of_track` (t,) indexes `kinds`; `apart`: pairs of tracks that cannot be one landmark."""

    track: tuple[Ints, ...]
    landmark_of_track: Ints
    kind_of_track: Ints
    kinds: tuple[str, ...]
    apart: frozenset[tuple[int, int]]

    @property
    def landmark_count(self) -> int:
        """How many landmarks there are."""
        return int(self.landmark_of_track.max()) + 1 if len(self.landmark_of_track) else 0


def is_signed(fleet: Fleet) -> bool:
    """Whether landmarks' detections carry known identities; those without one are then left aside."""
    return any(
        name and kind != VEHICLE
        for each in fleet.prepared
        for name, kind in zip(each.drive.detections.signature, each.drive.detections.kind, strict=True)
    )


def _named_tracks(fleet: Fleet) -> tuple[tuple[Ints, ...], Ints]:
    """Tracks by known signature, one a drive and signature, and the landmark (t,) each is of."""
    names: dict[str, int] = {}
    track: list[Ints] = []
    landmark: list[int] = []
    for each in fleet.prepared:
        own: dict[str, int] = {}
        column = np.full(len(each.drive.detections.signature), -1, dtype=np.int64)
        for row in np.nonzero(each.detection_usable)[0]:
            name = each.drive.detections.signature[row]
            if not name or each.drive.detections.kind[row] == VEHICLE:
                continue
            if name not in own:
                own[name] = len(landmark)
                landmark.append(names.setdefault(name, len(names)))
            column[row] = own[name]
        track.append(column)
    return tuple(track), np.array(landmark, dtype=np.int64)


def _linked_fleet(fleet: Fleet, state: MapState) -> tuple[tuple[Ints, ...], frozenset[tuple[int, int]]]:
    """Tracks of all drives, numbered through, and the pairs of them that were seen apart."""
    total, apart, track = 0, set(), []
    for each, point in zip(fleet.prepared, detections_in_map(fleet, state), strict=True):
        stamp_ns = each.drive.detections.stamp_ns
        usable = each.detection_usable & np.array([kind != VEHICLE for kind in each.drive.detections.kind], dtype=bool)
        own = linked_tracks(stamp_ns, point, usable, settings=fleet.settings.detections)
        apart |= {(a + total, b + total) for a, b in seen_together(own, stamp_ns)}
        track.append(np.where(own >= 0, own + total, -1))
        total += int(own.max(initial=-1)) + 1
    return tuple(track), frozenset(apart)


def _kinds_of_tracks(fleet: Fleet, track: tuple[Ints, ...], count: int) -> tuple[Ints, tuple[str, ...]]:
    """The most frequent kind (t,) of each track and the kinds' names."""
    kinds = tuple(sorted({kind for each in fleet.prepared for kind in each.drive.detections.kind}))
    number = {kind: index for index, kind in enumerate(kinds)}
    votes = np.zeros((count, max(len(kinds), 1)), dtype=np.int64)
    for each, own in zip(fleet.prepared, track, strict=True):
        kind = np.array([number[name] for name in each.drive.detections.kind], dtype=np.int64)
        np.add.at(votes, (own[own >= 0], kind[own >= 0]), 1)
    return votes.argmax(axis=1), kinds


def tracks_in_map(fleet: Fleet, state: MapState, association: Association) -> Tracks:
    """All tracks as the state places them."""
    track = np.concatenate(association.track)
    used, count = track >= 0, len(association.landmark_of_track)
    seen = np.maximum(np.bincount(track[used], minlength=count), 1)

    def mean(values: Floats) -> Floats:
        return np.bincount(track[used], weights=values[used], minlength=count) / seen

    point = np.concatenate(detections_in_map(fleet, state))
    drive = np.concatenate([np.full(len(own), index) for index, own in enumerate(association.track)])
    path = np.concatenate([each.motions.path.length_at(each.drive.detections.stamp_ns) for each in fleet.prepared])
    return Tracks(
        point_m=np.column_stack([mean(point[:, 0]), mean(point[:, 1])]),
        drive=mean(drive.astype(np.float64)).round().astype(np.int64),
        path_m=mean(path),
        kind=association.kind_of_track,
        apart=association.apart,
    )


def first_association(fleet: Fleet, state: MapState) -> Association:
    """Landmarks by known signatures where detections carry any, else by tracks, broken tracks mended, and joint
    shifts between passes and vehicles."""
    if is_signed(fleet):
        track, landmark = _named_tracks(fleet)
        kind, kinds = _kinds_of_tracks(fleet, track, len(landmark))
        return Association(track=track, landmark_of_track=landmark, kind_of_track=kind, kinds=kinds, apart=frozenset())
    track, apart = _linked_fleet(fleet, state)
    count = 1 + max((int(own.max(initial=-1)) for own in track), default=-1)
    kind, kinds = _kinds_of_tracks(fleet, track, count)
    single = Association(track=track, landmark_of_track=np.arange(count), kind_of_track=kind, kinds=kinds, apart=apart)
    tracks = tracks_in_map(fleet, state, single)
    groups = LandmarkGroups(count, apart)
    for a, b in close_pairs(tracks.point_m, SAME_PASS_GATE_M):
        if tracks.drive[a] == tracks.drive[b] and abs(tracks.path_m[a] - tracks.path_m[b]) < SAME_PASS_M:
            groups.join(int(a), int(b))
    for _, a, b in voted_pairs(tracks, settings=fleet.settings.detections):
        groups.join(a, b)
    return replace(single, landmark_of_track=groups.landmark_of_track())


def landmark_means(tracks: Tracks, landmark_of_track: Ints) -> Floats:
    """Mean position (l, 2) of each landmark's tracks."""
    count = np.bincount(landmark_of_track)
    sums = [np.bincount(landmark_of_track, weights=tracks.point_m[:, axis]) for axis in (0, 1)]
    return np.column_stack(sums) / np.maximum(count, 1)[:, None]


def renewed_association(fleet: Fleet, state: MapState, association: Association) -> Association:
    """The association after a solve: tracks that lie off their landmark leave it, landmarks that lie on one another
    become one."""
    if is_signed(fleet):
        return association
    tracks, settings = tracks_in_map(fleet, state, association), fleet.settings.detections
    off_m = np.hypot(*(tracks.point_m - state.landmark_m[association.landmark_of_track]).T)
    groups = LandmarkGroups(len(off_m), association.apart)
    first: dict[int, int] = {}
    for track in np.argsort(off_m, kind="stable"):
        landmark = int(association.landmark_of_track[track])
        if off_m[track] <= settings.split_gate_m:
            groups.join(first.setdefault(landmark, int(track)), int(track))
    _join_close(groups, tracks, settings)
    return replace(association, landmark_of_track=groups.landmark_of_track())


def _join_close(groups: LandmarkGroups, tracks: Tracks, settings: DetectionSettings) -> None:
    """Joins mutually nearest landmarks of the same kind within the gate until none is left."""
    for _ in range(JOINING_ROUNDS):
        landmark = groups.landmark_of_track()
        representative = np.unique(landmark, return_index=True)[1]
        changed = False
        for a, b in close_pairs(landmark_means(tracks, landmark), settings.merge_gate_m):
            one, other = int(representative[a]), int(representative[b])
            if tracks.kind[one] == tracks.kind[other]:
                changed |= groups.join(one, other)
        if not changed:
            return


def fleet_sightings(fleet: Fleet, association: Association) -> Sightings:
    """The averaged sightings of all drives but cameras' under the association."""
    return joined(
        [
            drive_sightings(
                each,
                _unless_camera(each, track),
                Averaging(
                    point_scale=fleet.frame.point_scale,
                    noise=noise,
                    shared_share=fleet.settings.detections.shared_share,
                    slack_m=fleet.settings.fixes.landmark_slack_m,
                ),
            )
            for each, track, noise in zip(fleet.prepared, association.track, fleet.noise, strict=True)
        ]
    )


def _unless_camera(prepared: PreparedDrive, track: Ints) -> Ints:
    """A camera's sightings are not averaged: its error is not in metres."""
    return np.full_like(track, -1) if prepared.camera else track


def fleet_single_sightings(fleet: Fleet, association: Association) -> SingleSightings:
    """The sightings of all drives that enter the graph one by one."""
    seeing = Seeing(point_scale=fleet.frame.point_scale, settings=fleet.settings.detections)
    return single_sightings(fleet.prepared, association.track, association.landmark_of_track, seeing)


def shared_tracks(sightings: Sightings, track_m: Floats) -> Floats:
    """The points (t, 2) of tracks whose sightings share an error, NaN for the others."""
    own = np.full_like(track_m, np.nan)
    chosen = np.unique(sightings.track[sightings.shared_m2 > 0.0])
    own[chosen] = track_m[chosen]
    return own


def with_measured_noise(fleet: Fleet, state: MapState, association: Association) -> Fleet:
    """The fleet with the noise that each drive's detections show against the solved landmarks."""
    noise = tuple(
        _measured_drive_noise(fleet, index, state, association.landmark_of_track, association.track[index])
        for index in range(len(fleet.prepared))
    )
    return replace(fleet, noise=noise)


def _measured_drive_noise(fleet: Fleet, index: int, state: MapState, landmark: Ints, track: Ints) -> DetectionNoise:
    each = fleet.prepared[index]
    untold = ~np.isfinite(perceived_covariances(each)).all(axis=(1, 2))
    rows = np.nonzero((_unless_camera(each, track) >= 0) & untold)[0]
    keyframe, scale = each.detection_keyframe[rows], fleet.frame.point_scale
    pose = state.drives[index].pose[keyframe]
    from_keyframe = state.landmark_m[landmark[track[rows]]] - pose[:, :2]
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    expected = np.column_stack(
        [c * from_keyframe[:, 0] + s * from_keyframe[:, 1], c * from_keyframe[:, 1] - s * from_keyframe[:, 0]]
    )
    return measured_noise(
        keyframe_points(each, point_scale=scale)[rows],
        expected,
        sensor_poses(each, point_scale=scale)[rows, :2],
        track[rows] * len(each.stamp_ns) + keyframe,
        fleet.noise[index],
    )

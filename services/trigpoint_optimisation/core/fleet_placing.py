"""Every drive that can be placed, placed: by its fixes, else by landmarks of known identity; the others left out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import AlignmentRefused
from trigpoint.events.drives import Drive
from trigpoint_optimisation.core.fleet import Fleet, Progress, detections_in_map, nominal_state
from trigpoint_optimisation.core.georeferencing import georeferenced
from trigpoint_optimisation.core.graph import scale_sigmas, turn_sigmas
from trigpoint_optimisation.core.joining import (
    MIN_COMMON,
    LocalDrive,
    Points,
    joined_drives,
    mean_points,
    moved,
    rigid_onto,
)
from trigpoint_optimisation.core.known_landmark_slam import KnownSightings, local_map
from trigpoint_optimisation.core.placing import placed_by_fixes
from trigpoint_optimisation.core.preparation import PreparedDrive
from trigpoint_optimisation.core.single_sightings import VEHICLE, Seeing, drive_single_sightings
from trigpoint_optimisation.core.state import DriveState, MapState
from trigpoint_optimisation.settings import CalibrationPriors

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SURE_SIGHTINGS = 3  # a landmark seen less often does not place a drive


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """A drive that is not in the map, and why."""

    vehicle: str
    boot_id: str
    reason: str

    def __str__(self) -> str:
        """One line for people."""
        return f"vehicle {self.vehicle}, drive {self.boot_id}: {self.reason}"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedFleet:
    """The drives that have a place, the state they have it in, whether all of them have it by fixes, and the rest."""

    fleet: Fleet
    state: MapState
    by_fixes: bool
    left_out: tuple[LeftOut, ...]


def drivable(drives: Sequence[Drive]) -> tuple[list[int], tuple[LeftOut, ...]]:
    """The drives (indices) that have a path at all, and the others."""
    chosen, left_out = [], []
    for index, drive in enumerate(drives):
        stamp_ns = drive.wheels.stamp_ns
        if len(stamp_ns) > 1 and stamp_ns[0] < stamp_ns[-1]:
            chosen.append(index)
            continue
        reason = f"{len(stamp_ns)} wheel measurements: without them its path is unknown"
        left_out.append(LeftOut(vehicle=drive.vehicle, boot_id=drive.boot_id, reason=reason))
    return chosen, tuple(left_out)


def subfleet(fleet: Fleet, indices: list[int]) -> Fleet:
    """Some drives of a fleet, numbered anew."""
    return replace(
        fleet,
        prepared=tuple(replace(fleet.prepared[i], index=number) for number, i in enumerate(indices)),
        trusted=tuple(fleet.trusted[i] for i in indices),
        fixes=tuple(fleet.fixes[i] for i in indices),
        noise=tuple(fleet.noise[i] for i in indices),
    )


def placed_fleet(
    fleet: Fleet, anchor_m: Points, *, left_out: tuple[LeftOut, ...] = (), progress: Progress
) -> PlacedFleet:
    """All drives that fixes, common landmarks of known identity or anchors of known identity place.

    anchor_m: where anchors of known identity are; left_out: drives left out before.
    Raises AlignmentRefused where no drive can be placed.
    """
    refused = _refused_by_fixes(fleet)
    by_fixes = [index for index in range(len(fleet.prepared)) if index not in refused]
    located, states = dict[int, Fleet](), dict[int, DriveState]()
    known: Points = {}
    if by_fixes:
        sure, state = georeferenced(subfleet(fleet, by_fixes), progress=progress)
        known = _known_points(sure, state)
        located = {index: subfleet(sure, [number]) for number, index in enumerate(by_fixes)}
        states = dict(zip(by_fixes, state.drives, strict=True))
    for index, local in _joined_to_map(fleet, list(refused), known, anchor_m).items():
        located[index] = _without_fixes(subfleet(fleet, [index]))
        states[index] = nominal_state(located[index], [local.pose]).drives[0]
    left_out += tuple(_left_out(fleet, index, why) for index, why in refused.items() if index not in located)
    if not located:
        raise AlignmentRefused("; ".join(map(str, left_out)) or "there is no drive")
    order = sorted(located)
    whole = _united([located[index] for index in order])
    state = MapState(
        drives=tuple(states[index] for index in order), landmark_m=np.zeros((0, 2)), image_m=np.zeros((0, 2))
    )
    return PlacedFleet(fleet=whole, state=state, by_fixes=order == by_fixes, left_out=left_out)


def _refused_by_fixes(fleet: Fleet) -> dict[int, str]:
    """The drives whose fixes do not determine their path, and why."""
    refused = {}
    for index, (each, trusted) in enumerate(zip(fleet.prepared, fleet.trusted, strict=True)):
        try:
            placed_by_fixes(each, trusted, point_scale=fleet.frame.point_scale)
        except AlignmentRefused as error:
            refused[index] = str(error)
    return refused


def _without_fixes(fleet: Fleet) -> Fleet:
    """The fleet with none of its fixes trusted, and no state for their slow error."""
    nothing = tuple(np.zeros_like(trusted) for trusted in fleet.trusted)
    white = tuple(replace(fixes, bias_sigma_m=0.0) for fixes in fleet.fixes)
    return replace(fleet, trusted=nothing, fixes=white)


def _united(parts: list[Fleet]) -> Fleet:
    prepared = [each for part in parts for each in part.prepared]
    return replace(
        parts[0],
        prepared=tuple(replace(each, index=index) for index, each in enumerate(prepared)),
        trusted=tuple(trusted for part in parts for trusted in part.trusted),
        fixes=tuple(fixes for part in parts for fixes in part.fixes),
        noise=tuple(noise for part in parts for noise in part.noise),
    )


def _left_out(fleet: Fleet, index: int, why: str) -> LeftOut:
    drive = fleet.prepared[index].drive
    tie = f"fewer than {MIN_COMMON} landmarks of known identity tie it to placed drives or, method anchored, to anchors"
    reason = f"{why}; and {tie}"
    return LeftOut(vehicle=drive.vehicle, boot_id=drive.boot_id, reason=reason)


def _signed_rows(prepared: PreparedDrive) -> Ints:
    """The usable detections (indices) of landmarks of known identity."""
    detections = prepared.drive.detections
    pairs = zip(detections.signature, detections.kind, strict=True)
    signed = np.array([bool(name) and kind != VEHICLE for name, kind in pairs], dtype=bool)
    return np.nonzero(signed & prepared.detection_usable)[0]


def _known_points(fleet: Fleet, state: MapState) -> dict[str, Floats]:
    """Where placed drives see landmarks of known identity, by medians."""
    seen: dict[str, list[Floats]] = {}
    for each, point_m in zip(fleet.prepared, detections_in_map(fleet, state), strict=True):
        for row in _signed_rows(each):
            seen.setdefault(each.drive.detections.signature[row], []).append(point_m[row])
    return {name: np.median(points, axis=0) for name, points in seen.items() if len(points) >= SURE_SIGHTINGS}


def _joined_to_map(fleet: Fleet, indices: list[int], known: Points, anchor_m: Points) -> dict[int, LocalDrive]:
    """The drives that landmarks of known identity tie to placed drives, or else to anchors."""
    local = {index: _local_drive(fleet, index) for index in indices}
    placed: dict[int, LocalDrive] = {}
    for group in joined_drives({index: each for index, each in local.items() if each.point_m}):
        point_m = mean_points([each.point_m for each in group.values()])
        motion = rigid_onto(point_m, known)
        if motion is None:
            motion = rigid_onto(point_m, anchor_m)
        if motion is not None:
            placed |= {index: moved(each, motion) for index, each in group.items()}
    return placed


def _local_drive(fleet: Fleet, index: int) -> LocalDrive:
    """The drive in its own frame, with the landmarks it is sure of."""
    each, rows = fleet.prepared[index], _signed_rows(fleet.prepared[index])
    rows = rows[np.argsort(each.detection_keyframe[rows], kind="stable")]
    names = sorted({each.drive.detections.signature[row] for row in rows})
    number: Mapping[str, int] = {name: index for index, name in enumerate(names)}
    seeing = Seeing(point_scale=fleet.frame.point_scale, settings=fleet.settings.detections)
    seen = drive_single_sightings(each, rows, seeing)
    sightings = KnownSightings(
        keyframe=seen.keyframe,
        landmark=np.array([number[each.drive.detections.signature[row]] for row in rows], dtype=np.int64),
        ln_range=seen.ln_range,
        bearing_rad=seen.bearing_rad,
        T_keyframe_sensor=seen.T_keyframe_sensor,
    )
    found = local_map(
        each.motions.delta,
        _uncalibrated_noise(each, fleet.settings.calibration),
        sightings,
        landmark_count=len(names),
    )
    sure = {name: found.landmark_m[i] for name, i in number.items() if found.count[i] >= SURE_SIGHTINGS}
    return LocalDrive(pose=found.pose, point_m=sure)


def _uncalibrated_noise(prepared: PreparedDrive, priors: CalibrationPriors) -> Floats:
    """Covariances (n-1, 3, 3) of the motions at nominal calibration, the calibration's own uncertainty included."""
    sigma = np.append(scale_sigmas(prepared, priors), turn_sigmas(prepared.source, priors)[1])
    spread = prepared.motions.derivative * sigma
    covariance: Floats = prepared.motions.covariance + spread @ spread.transpose(0, 2, 1)
    return covariance

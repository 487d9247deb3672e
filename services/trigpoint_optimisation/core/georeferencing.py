"""Odometry and fixes solved alone to convergence, before any landmark joins."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import AlignmentRefused
from trigpoint_optimisation.core.fix_noise import fix_residuals
from trigpoint_optimisation.core.fleet import (
    Fleet,
    Progress,
    georeferenced_graph,
    nominal_state,
    recalibrated,
    solved_state,
    with_measured_fixes,
    with_poses,
    without_fix_bias,
)
from trigpoint_optimisation.core.odometry import TurnSource
from trigpoint_optimisation.core.placing import placed_by_fixes
from trigpoint_optimisation.core.sampled_placing import sampled_path, wrapped_pose
from trigpoint_optimisation.core.state import MapState
from trigpoint_optimisation.settings import SAMPLED_SELECTION_EDGES, SELECTION_EDGES

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

PLACINGS = 2  # the second one with the calibration the first one led to
TRUST_M = 12.0  # a fix further than this from the robust path is not trusted: five sigmas of a usual slow error
LONG_OUTAGE_S = 150.0  # before and after an outage longer than this,
SAMPLED_OUTAGE_S = 10.0  # where a fix a second is due and the odometry could not tell a drifting one
MIN_FIXES = 10  # fewer do not determine a path beside its calibration
BEFORE_OUTAGE_S = 30.0  # a receiver that lost its satellites extrapolates for so long,
AFTER_OUTAGE_S = 5.0  # and needs so long to settle again


def georeferenced(fleet: Fleet, *, progress: Progress) -> tuple[Fleet, MapState]:
    """The fleet with calibrated motions and only fixes trusted that agree with the path, and its state.

    A plain solve first, then robust ones, all in which a fix says little; they decide about each fix; then the solve
    with the settings' edges. Raises AlignmentRefused with the drive's name when its fixes do not determine its path.
    """
    if all(each.source is TurnSource.SAMPLED_WHEELS for each in fleet.prepared):
        return _finished(*_sampled(fleet), progress)
    allowed, state = fleet.trusted, None
    for turn in range(PLACINGS):
        earlier = [None] * len(allowed) if state is None else [drive.pose for drive in state.drives]
        placed = [_placed(fleet, index, allowed[index], earlier[index]) for index in range(len(fleet.prepared))]
        pose = [each for each, _ in placed]
        fleet = replace(fleet, trusted=tuple(consistent for _, consistent in placed))
        state = nominal_state(fleet, pose) if state is None else with_poses(state, pose)
        state = _weakly_solved(fleet, state, robust=turn > 0)
        fleet = recalibrated(fleet, state)
        progress("odometry and fixes", (turn + 1) / (PLACINGS + 2))
    assert state is not None
    fleet, state = _selected(fleet, state, allowed)
    return _finished(fleet, state, progress)


def _finished(fleet: Fleet, state: MapState, progress: Progress) -> tuple[Fleet, MapState]:
    """The fleet and its state solved with the settings' edges from trusted fixes."""
    progress("odometry and fixes", (PLACINGS + 1) / (PLACINGS + 2))
    if fleet.settings.chosen_edges == "honest":
        fleet, state = with_measured_fixes(fleet, state)
    state = solved_state(georeferenced_graph(fleet, robust=True), state)
    progress("odometry and fixes", 1.0)
    return recalibrated(fleet, state), state


def _sampled(fleet: Fleet) -> tuple[Fleet, MapState]:
    """Placed drives whose wheels were only sampled, with the fixes near their robust paths trusted."""
    scale, paths, trusted = fleet.frame.point_scale, [], []
    for each, allowed in zip(fleet.prepared, fleet.trusted, strict=True):
        stamp_ns = each.drive.fixes.stamp_ns
        usable = allowed & each.fix_usable
        usable[usable] = settled(stamp_ns[usable], outage_s=SAMPLED_OUTAGE_S)
        if usable.sum() < MIN_FIXES:
            name = f"vehicle {each.drive.vehicle}, drive {each.drive.boot_id}"
            raise AlignmentRefused(f"{name}: {usable.sum()} usable fixes, at least {MIN_FIXES} needed")
        paths.append(sampled_path(each, usable, fleet.settings, point_scale=scale))
        trusted.append(usable)
    state = nominal_state(fleet, [wrapped_pose(path) for path in paths])
    drives = tuple(
        replace(drive, scale=path.calibration[:3], turn_bias=np.full(len(drive.turn_bias), path.calibration[3]))
        for drive, path in zip(state.drives, paths, strict=True)
    )
    state = replace(state, drives=drives)
    fleet = recalibrated(fleet, state)
    near = [np.hypot(*fix_residuals(e, d).T) <= TRUST_M for e, d in zip(fleet.prepared, drives, strict=True)]
    return replace(fleet, trusted=tuple(a & b for a, b in zip(trusted, near, strict=True))), state


def _weakly_solved(fleet: Fleet, state: MapState, *, robust: bool) -> MapState:
    """The state of a solve in which a fix says little."""
    edges = tuple(
        SAMPLED_SELECTION_EDGES if each.source is TurnSource.SAMPLED_WHEELS else SELECTION_EDGES
        for each in fleet.prepared
    )
    weak = replace(fleet, fixes=edges)
    found = solved_state(georeferenced_graph(weak, robust=robust), without_fix_bias(weak, state))
    return without_fix_bias(fleet, found)


def _selected(fleet: Fleet, state: MapState, allowed: tuple[Bools, ...]) -> tuple[Fleet, MapState]:
    """The fleet with the allowed fixes trusted that lie near the path of a robust solve, and that path's state."""
    found = _weakly_solved(replace(fleet, trusted=allowed), state, robust=True)
    trusted = []
    for each, drive, mask in zip(fleet.prepared, found.drives, allowed, strict=True):
        near = np.hypot(*fix_residuals(each, drive).T) <= TRUST_M
        trusted.append(mask & each.fix_usable & near & settled(each.drive.fixes.stamp_ns))
    return replace(recalibrated(fleet, found), trusted=tuple(trusted)), found


def settled(stamp_ns: NDArray[np.int64], *, outage_s: float = LONG_OUTAGE_S) -> Bools:
    """Which fixes (n,), sorted by time, are neither the last before nor the first after a long outage."""
    outage = np.nonzero(np.diff(stamp_ns) > outage_s * 1e9)[0]
    keep = np.ones(len(stamp_ns), dtype=bool)
    for last in outage:
        keep &= ~((stamp_ns <= stamp_ns[last]) & (stamp_ns > stamp_ns[last] - BEFORE_OUTAGE_S * 1e9))
        keep &= ~((stamp_ns >= stamp_ns[last + 1]) & (stamp_ns < stamp_ns[last + 1] + AFTER_OUTAGE_S * 1e9))
    return keep


def _placed(fleet: Fleet, index: int, allowed: Bools, solved: Floats | None) -> tuple[Floats, Bools]:
    prepared = fleet.prepared[index]
    try:
        return placed_by_fixes(prepared, allowed, point_scale=fleet.frame.point_scale, solved=solved)
    except AlignmentRefused as error:
        raise AlignmentRefused(f"vehicle {prepared.drive.vehicle}, drive {prepared.drive.boot_id}: {error}") from error

"""Odometry and fixes solved alone to convergence, before any landmark joins."""

from dataclasses import replace

from trigpoint.errors import AlignmentRefused
from trigpoint_optimisation.core.fleet import (
    Fleet,
    Progress,
    georeferenced_graph,
    nominal_state,
    recalibrated,
    solved_state,
    with_measured_fixes,
    with_poses,
)
from trigpoint_optimisation.core.placing import placed_by_fixes
from trigpoint_optimisation.core.state import MapState

PLACINGS = 2  # the second one with the calibration the first one led to


def georeferenced(fleet: Fleet, *, progress: Progress) -> tuple[Fleet, MapState]:
    """The fleet with calibrated motions and inconsistent fixes no longer trusted, and its state.

    Plain solves first, then one with the robust kernel on fixes. Raises AlignmentRefused with the drive's name
    when its fixes do not determine its path.
    """
    allowed, state = fleet.trusted, None
    for turn in range(PLACINGS):
        placed = [_placed(fleet, index, allowed) for index in range(len(fleet.prepared))]
        pose = [each for each, _ in placed]
        fleet = replace(fleet, trusted=tuple(consistent for _, consistent in placed))
        state = nominal_state(fleet, pose) if state is None else with_poses(state, pose)
        state = solved_state(georeferenced_graph(fleet, robust=False), state)
        fleet = recalibrated(fleet, state)
        progress("odometry and fixes", (turn + 1) / (PLACINGS + 1))
    assert state is not None
    if fleet.settings.edges == "honest":
        fleet, state = with_measured_fixes(fleet, state)
    state = solved_state(georeferenced_graph(fleet, robust=True), state)
    progress("odometry and fixes", 1.0)
    return recalibrated(fleet, state), state


def _placed(fleet: Fleet, index: int, allowed):  # type: ignore[no-untyped-def]
    prepared = fleet.prepared[index]
    try:
        return placed_by_fixes(prepared, allowed[index], point_scale=fleet.frame.point_scale)
    except AlignmentRefused as error:
        raise AlignmentRefused(f"vehicle {prepared.drive.vehicle}, drive {prepared.drive.boot_id}: {error}") from error

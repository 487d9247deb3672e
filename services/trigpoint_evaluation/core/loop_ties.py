"""The closed loops that tie the legs a landmark was seen from, and what the map leaves of each."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.mapped import TrajectorySolved
from trigpoint.geodesy.poses import Pose2, wrap_angle_rad
from trigpoint_evaluation.core.explanation import DriveName, LoggedLoop, Sighting, TiedLoop, base_pose

Ints = NDArray[np.int64]

LEG_NS = 1_000_000_000  # as long as a leg between two keyframes lasts at most where a vehicle moves


def loops_behind(
    loops: Iterable[LoggedLoop], sightings: Sequence[Sighting], paths: Mapping[DriveName, TrajectorySolved]
) -> tuple[TiedLoop, ...]:
    """Of the loops between drives that have paths those with an end within `LEG_NS` of a sighting, in order of time."""
    seen_ns = _seen_ns(sightings)
    tied = [
        TiedLoop(loop=loop, residual=_residual(loop, paths))
        for loop in loops
        if all(name in paths for name, _ in _ends(loop))
        and any(_is_beside(stamp_ns, seen_ns.get(name)) for name, stamp_ns in _ends(loop))
    ]
    return tuple(sorted(tied, key=lambda each: (each.loop.stamp_ns, each.loop.position.number)))


def _seen_ns(sightings: Sequence[Sighting]) -> dict[DriveName, Ints]:
    """When each drive saw the landmark (n,), sorted."""
    names = {(one.vehicle, one.boot_id) for one in sightings}
    return {
        name: np.sort(
            np.array([one.stamp_ns for one in sightings if (one.vehicle, one.boot_id) == name], dtype=np.int64)
        )
        for name in names
    }


def _ends(loop: LoggedLoop) -> tuple[tuple[DriveName, int], tuple[DriveName, int]]:
    """Drive and stamp of the loop's sweep and of the other."""
    event = loop.event
    own = (event.vehicle, event.boot_id), loop.stamp_ns
    return own, ((event.other_vehicle, event.other_boot_id), event.other_stamp_ns)


def _is_beside(stamp_ns: int, seen_ns: Ints | None) -> bool:
    if seen_ns is None:
        return False
    first, after = np.searchsorted(seen_ns, (stamp_ns - LEG_NS, stamp_ns + LEG_NS + 1))
    return bool(first < after)


def _residual(loop: LoggedLoop, paths: Mapping[DriveName, TrajectorySolved]) -> tuple[float, float, float] | None:
    (name, stamp_ns), (other, other_ns) = _ends(loop)
    T_map_one, T_map_other = base_pose(paths.get(name), stamp_ns), base_pose(paths.get(other), other_ns)
    if T_map_one is None or T_map_other is None:
        return None
    event, mapped = loop.event, T_map_other.inverse().compose(T_map_one)
    measured = Pose2(event.x_m, event.y_m, event.heading_rad)
    turn_rad = wrap_angle_rad(measured.heading_rad - mapped.heading_rad)
    return measured.x_m - mapped.x_m, measured.y_m - mapped.y_m, turn_rad

"""Points brought to where they would have been measured had the vehicle stood still at the sweep's stamp."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from trigpoint.compiled import compiled
from trigpoint.errors import EventRejected
from trigpoint_perception.core.velocity import motions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SLOT_NS = 500_000  # points of so short a time share one pose: within 5 mm at 20 m/s
REACH_NS = 150_000_000  # beyond a path's ends its motion is taken to go on: one sweep
HELD_NS = 250_000_000  # about a sweep's stamp: so long a velocity is taken to hold
NS_PER_S = 1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class Path:
    """Poses of the base at rising stamps (n,), n at least 2: position_m (n, 3) and rotation in any fixed frame."""

    stamp_ns: Ints
    position_m: Floats
    rotation: Rotation


def planar_path(stamp_ns: Ints, pose: Floats) -> Path:
    """The path of a base that keeps level; pose (n, 3): x, y in m, heading in rad, as maps and odometry have it.

    Raises EventRejected "no path" for fewer than two poses or stamps that do not rise.
    """
    if len(stamp_ns) < 2 or not np.all(np.diff(stamp_ns) > 0):
        raise EventRejected("no path", f"{len(stamp_ns)} poses with stamps in order: at least 2 that rise are needed")
    position_m = np.column_stack([pose[:, :2], np.zeros(len(pose))])
    return Path(stamp_ns=stamp_ns, position_m=position_m, rotation=Rotation.from_euler("z", pose[:, 2:3]))


def poses_at(path: Path, stamp_ns: Ints) -> tuple[Floats, Floats]:
    """Positions (m, 3) and rotation matrices (m, 3, 3) at stamps (m,), interpolated: straight, and turning evenly.

    Up to REACH_NS beyond its ends the path goes on as it was. Raises EventRejected "no path" farther away.
    """
    first_ns, last_ns = int(path.stamp_ns[0]), int(path.stamp_ns[-1])
    if int(stamp_ns.min()) < first_ns - REACH_NS or int(stamp_ns.max()) > last_ns + REACH_NS:
        raise EventRejected(
            "no path",
            f"points of {int(stamp_ns.min())} to {int(stamp_ns.max())} ns, and the path is known of "
            f"{first_ns} to {last_ns} ns",
        )
    t_s, at_s = (path.stamp_ns - first_ns) / NS_PER_S, (stamp_ns - first_ns) / NS_PER_S
    after = np.clip(np.searchsorted(t_s, at_s), 1, len(t_s) - 1)
    share = ((at_s - t_s[after - 1]) / (t_s[after] - t_s[after - 1]))[:, None]
    position_m = path.position_m[after - 1] + share * (path.position_m[after] - path.position_m[after - 1])
    step, of_step = np.unique(after, return_inverse=True)
    before, next_ = path.rotation[step - 1], path.rotation[step]
    turn = (before.inv() * next_).as_rotvec()[of_step]
    return position_m, before.as_matrix()[of_step] @ Rotation.from_rotvec(share * turn).as_matrix()


def deskewed(point_m: Floats, offset_ns: Ints, *, stamp_ns: int, path: Path) -> Floats:
    """Points (n, 3) in the base frame at the sweep's stamp, from points each in the base frame at its own time.

    Raises EventRejected "no path" where the path does not cover the sweep.
    """
    slot, middle_ns = _slots(offset_ns)
    position_m, rotation = poses_at(path, np.append(stamp_ns + middle_ns, np.int64(stamp_ns)))
    to_stamp = rotation[-1].T
    moved_m = (position_m[:-1] - position_m[-1]) @ to_stamp.T
    return _moved(point_m, slot, moved_m, to_stamp @ rotation[:-1])


def deskewed_by_velocity(point_m: Floats, offset_ns: Ints, velocity: Floats) -> Floats:
    """As `deskewed`, of a base whose velocity (6,) was the same all the while.

    Raises EventRejected "no path" where points are farther from the stamp than HELD_NS.
    """
    slot, middle_ns = _slots(offset_ns)
    farthest_ns = int(np.abs(middle_ns).max())
    if farthest_ns > HELD_NS:
        raise EventRejected("no path", f"points up to {farthest_ns} ns from the stamp, at most {HELD_NS} ns are")
    return _moved(point_m, slot, *motions(velocity, middle_ns / NS_PER_S))


def _slots(offset_ns: Ints) -> tuple[Ints, Ints]:
    """The short time (n,) each point falls into, and those times' middles (m,) as offsets."""
    first_ns, last_ns = int(offset_ns.min()), int(offset_ns.max())
    slots = (last_ns - first_ns) // SLOT_NS + 1
    middle_ns = first_ns + SLOT_NS * np.arange(slots, dtype=np.int64) + SLOT_NS // 2
    if slots == 1:
        middle_ns = np.array([(first_ns + last_ns) // 2], dtype=np.int64)
    return (offset_ns - first_ns) // SLOT_NS, middle_ns


@compiled
def _moved(point_m: Floats, slot: Ints, moved_m: Floats, turned: Floats) -> Floats:
    result = np.empty_like(point_m)
    for row in range(len(point_m)):
        number = slot[row]
        for axis in range(3):
            result[row, axis] = moved_m[number, axis]
            for other in range(3):
                result[row, axis] += turned[number, axis, other] * point_m[row, other]
    return result

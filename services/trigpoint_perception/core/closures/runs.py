"""A drive's matched sweeps as unbroken runs, and what was seen of them, as arrays."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.perceived import LandmarksPerceived, OdometryMatched, PerceivedLandmark
from trigpoint.geodesy.poses import Pose2

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """Sweeps (n,) of one sensor, each matched to the one before. sequence (n,) and stamp_ns (n,) of each; pose (n, 3)
    of the base, x, y in m and heading in rad, in its frame at the first; path_m (n,) driven since.

    Sights (m,): row (m,) of their sweep, track (m,), kind (m,), point_m (m, 2) and covariance_m2 (m, 2, 2) in the base
    frame at their sweep.
    """

    vehicle: str
    boot_id: str
    sensor: str
    sequence: Ints
    stamp_ns: Ints
    pose: Floats
    path_m: Floats
    row: Ints
    track: Ints
    kind: tuple[str, ...]
    point_m: Floats
    covariance_m2: Floats


def runs_of(
    motions: Iterable[OdometryMatched], stamp_ns: Sequence[int], seen: Iterable[LandmarksPerceived]
) -> list[Run]:
    """The runs of a drive, each sensor's by itself; `stamp_ns` are the motions'.

    Motions of one sensor come in their order, each from the sweep of the one before or from one that begins a run.
    """
    chains: dict[str, list[list[_Link]]] = {}
    for motion, stamp in zip(motions, stamp_ns, strict=True):
        of_sensor = chains.setdefault(motion.sensor, [])
        if not of_sensor or of_sensor[-1][-1].motion.sweep_sequence != motion.from_sequence:
            of_sensor.append([])
        of_sensor[-1].append(_Link(motion, stamp))
    by_sweep = {(each.sensor, each.sweep_sequence): each.landmarks for each in seen}
    return [_run(chain, by_sweep) for of_sensor in chains.values() for chain in of_sensor]


@dataclass(frozen=True, slots=True)
class _Link:
    """A motion and its stamp."""

    motion: OdometryMatched
    stamp_ns: int


def _run(chain: list[_Link], by_sweep: Mapping[tuple[str, int], tuple[PerceivedLandmark, ...]]) -> Run:
    first = chain[0].motion
    sequence = [first.from_sequence, *(link.motion.sweep_sequence for link in chain)]
    pose = _poses(chain)
    sights = [(row, sight) for row, each in enumerate(sequence) for sight in by_sweep.get((first.sensor, each), ())]
    return Run(
        vehicle=first.vehicle,
        boot_id=first.boot_id,
        sensor=first.sensor,
        sequence=np.array(sequence, dtype=np.int64),
        stamp_ns=np.array([first.from_stamp_ns, *(link.stamp_ns for link in chain)], dtype=np.int64),
        pose=pose,
        path_m=np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(pose[:, :2], axis=0).T))]),
        row=np.array([row for row, _ in sights], dtype=np.int64),
        track=np.array([sight.track for _, sight in sights], dtype=np.int64),
        kind=tuple(sight.kind for _, sight in sights),
        point_m=np.array([(sight.x_m, sight.y_m) for _, sight in sights]).reshape(-1, 2),
        covariance_m2=np.array([_covariance_m2(sight) for _, sight in sights]).reshape(-1, 2, 2),
    )


def _poses(chain: list[_Link]) -> Floats:
    """The base's poses (n, 3) along a chain of motions, from the origin on."""
    poses = [Pose2(0.0, 0.0, 0.0)]
    for link in chain:
        poses.append(poses[-1].compose(Pose2(link.motion.x_m, link.motion.y_m, link.motion.heading_rad)))
    return np.array([(each.x_m, each.y_m, each.heading_rad) for each in poses])


def _covariance_m2(sight: PerceivedLandmark) -> list[list[float]]:
    return [[sight.variance_x_m2, sight.covariance_xy_m2], [sight.covariance_xy_m2, sight.variance_y_m2]]

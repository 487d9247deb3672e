"""What the optimiser solved: one map version is one MapSolved and what stands before it. Writer: optimisation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class MapSolved:
    """A map version was solved from the log up to `inputs` (stream, count) with `settings_json`.

    Appended last: a version without it is not there. `base_version` 0: the version is whole in itself. Else only what
    differs from that version stands in its events: a landmark, trajectory, anchor or image not among them is as it was
    there, and the landmarks `removed` are in the map no more.
    """

    map_version: int
    method: str
    settings_json: str
    inputs: tuple[tuple[str, int], ...]
    landmark_count: int
    anchor_count: int
    wall_s: float
    base_version: int = 0
    removed: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class TrajectorySolved:
    """One drive's path. stamp_ns (n,); pose (n, 3): x, y in m, heading in rad, base in map frame;
    covariance (n, 3, 3). `calibration` (name, value, sigma) are the drive's calibration states, in the
    unit the name ends with.
    """

    map_version: int
    vehicle: str
    boot_id: str
    stamp_ns: Ints
    pose: Floats
    covariance: Floats
    calibration: tuple[tuple[str, float, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarkSolved:
    """One landmark of a map version. position (2,): x, y in m, map frame; covariance (2, 2) in m^2.

    `landmark` is stable between versions. `observations` are where its detections stand: (vehicle, boot_id,
    sequence of the sweep); in a version upon another (`MapSolved.base_version`) those since it, which come on top of
    those before. `anchors` are the labels tied to it.
    """

    map_version: int
    landmark: str
    kind: str
    signature: str
    position_m: Floats
    covariance_m2: Floats
    observation_count: int
    vehicles: tuple[str, ...]
    first_seen_ns: int
    last_seen_ns: int
    anchors: tuple[str, ...]
    observations: tuple[tuple[str, str, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchorAssociated:
    """What became of one anchor: the landmark it was tied to (or "" and why not) and the residual left.

    residual (2,): label minus landmark minus image offset, m. `image` is the one it was labelled in, empty for a
    survey and in what was written before images were named here: an anchor is known by its name and its image.
    """

    map_version: int
    anchor: str
    landmark: str
    reason: str
    residual_m: Floats
    image: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageOffsetSolved:
    """An aerial image's own offset. offset (2,): label minus true position, m; covariance (2, 2) in m^2."""

    map_version: int
    image: str
    offset_m: Floats
    covariance_m2: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelGainSolved:
    """What one more label would tell of a map that was solved whole, for each of its `landmarks` (l).

    The label lies in `image`, one the map knows the offset of; empty: in none of them. expected_m2 (l, 3): covariance
    xx, xy, yy of where such a label lies but for its own noise; shared_m4 (l, 3): the same entries of its covariances
    with all landmarks, multiplied with their transpose and summed. A label of covariance R then lowers the landmarks'
    summed variance by the trace of (expected + R)^-1 shared.
    """

    map_version: int
    image: str
    landmarks: tuple[str, ...]
    expected_m2: Floats
    shared_m4: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryCorrected:
    """Where a vehicle's own dead reckoning lies in the map, for the vehicle to place itself by.

    T_map_odom (3,): x, y in m, heading in rad, of the odometry frame in the map frame: T_map_base = T_map_odom
    composed with T_odom_base, the latter from the nominal dead reckoning of the boot since its first wheel message.
    covariance (3, 3) of the base in the map frame at the event's stamp: x, y in m, heading in rad. `map_version` is the
    newest one the correction agrees with.
    """

    vehicle: str
    boot_id: str
    map_version: int
    T_map_odom: Floats
    covariance: Floats


Mapped = MapSolved | TrajectorySolved | LandmarkSolved | AnchorAssociated | ImageOffsetSolved | LabelGainSolved

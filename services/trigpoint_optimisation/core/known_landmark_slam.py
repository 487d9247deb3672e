"""A drive among landmarks of known identity, followed in a frame of its own: no fix is needed.

An extended Kalman filter over the pose and all landmarks (Smith, Self and Cheeseman 1990; Durrant-Whyte and Bailey
2006) over odometry and range-bearing sightings, good enough to start a solve from.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.poses import wrap_angle_rad

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LN_RANGE_SIGMA = 0.06  # of an uncalibrated sensor
BEARING_SIGMA_RAD = 0.03
START_SIGMA = 1e-3  # m and rad: the frame is the drive's own
GATE_SIGMAS = 8.0  # joint, of ln range and bearing; odometry is not calibrated either
REJECTED_IN_A_ROW = 5  # so many mean that the pose is lost, not that all sightings are wrong
REOPENED_SIGMA = 0.3  # m and rad, of a lost pose
DOUBTED_SIGHTINGS = 2  # a landmark seen no more than so often was misread
DOUBTED_REJECTIONS = 3  # if so many later sightings disagree


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownSightings:
    """Sightings (s,) in order of keyframe: keyframe, landmark number, ln_range in m, bearing_rad, and
    T_keyframe_sensor (s, 3)."""

    keyframe: Ints
    landmark: Ints
    ln_range: Floats
    bearing_rad: Floats
    T_keyframe_sensor: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalMap:
    """A drive in its own frame. pose (n, 3) of the keyframes, landmark_m (l, 2), and how many sightings (l,) each
    landmark was made from (0: never seen)."""

    pose: Floats
    landmark_m: Floats
    count: Ints


class _Filter:
    """State x: pose (3,), then x, y of each landmark; its covariance; sightings taken and refused per landmark."""

    def __init__(self, landmark_count: int) -> None:
        self.x = np.zeros(3 + 2 * landmark_count)
        self.covariance = np.zeros((len(self.x), len(self.x)))
        self.covariance[:3, :3] = START_SIGMA**2 * np.eye(3)
        self.count = np.zeros(landmark_count, dtype=np.int64)
        self._refused = np.zeros(landmark_count, dtype=np.int64)
        self._in_a_row = 0
        self._noise = np.diag([LN_RANGE_SIGMA**2, BEARING_SIGMA_RAD**2])

    def move(self, delta: Floats, noise: Floats) -> None:
        """One motion (3,) in the pose's own frame with covariance (3, 3)."""
        c, s = np.cos(self.x[2]), np.sin(self.x[2])
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        step = rotation @ delta
        by_pose = np.array([[1.0, 0.0, -step[1]], [0.0, 1.0, step[0]], [0.0, 0.0, 1.0]])
        self.x[:3] += step
        self.covariance[:3] = by_pose @ self.covariance[:3]
        self.covariance[:, :3] = self.covariance[:, :3] @ by_pose.T
        self.covariance[:3, :3] += rotation @ noise @ rotation.T

    def see(self, landmark: int, ln_range: float, bearing_rad: float, T_keyframe_sensor: Floats) -> None:
        """One sighting: a new landmark, or a correction if it is within the gate."""
        c, s = np.cos(self.x[2]), np.sin(self.x[2])
        ahead, left, turned = T_keyframe_sensor
        arm = np.array([c * ahead - s * left, s * ahead + c * left])
        direction = self.x[2] + turned
        rows = slice(3 + 2 * landmark, 5 + 2 * landmark)
        if not self.count[landmark]:
            self._add(rows, arm, ln_range, direction + bearing_rad)
            self.count[landmark] = 1
            return
        to = self.x[rows] - self.x[:2] - arm
        square = max(float(to @ to), 1e-2)
        polar = np.array([to, (-to[1], to[0])]) / square
        by_state = np.zeros((2, len(self.x)))
        by_state[:, :2], by_state[:, rows] = -polar, polar
        by_state[:, 2] = -polar @ (-arm[1], arm[0]) - (0.0, 1.0)
        off = np.array(
            [ln_range - 0.5 * np.log(square), wrap_angle_rad(bearing_rad + direction - np.arctan2(to[1], to[0]))]
        )
        self._correct(landmark, off, by_state)

    def _add(self, rows: slice, arm: Floats, ln_range: float, angle_rad: float) -> None:
        range_m = np.exp(ln_range)
        c, s = np.cos(angle_rad), np.sin(angle_rad)
        seen = range_m * np.array([c, s])
        self.x[rows] = self.x[:2] + arm + seen
        by_pose = np.array([[1.0, 0.0, -(arm + seen)[1]], [0.0, 1.0, (arm + seen)[0]]])
        by_seen = range_m * np.array([[c, -s], [s, c]])
        self.covariance[rows] = by_pose @ self.covariance[:3]
        self.covariance[:, rows] = self.covariance[rows].T
        own = by_pose @ self.covariance[:3, :3] @ by_pose.T
        self.covariance[rows, rows] = own + by_seen @ self._noise @ by_seen.T

    def _correct(self, landmark: int, off: Floats, by_state: Floats) -> None:
        gain = self.covariance @ by_state.T
        spread = by_state @ gain + self._noise
        if off @ np.linalg.solve(spread, off) > GATE_SIGMAS**2:
            self._refuse(landmark)
            return
        weight = np.linalg.solve(spread, gain.T).T
        self.x += weight @ off
        self.covariance -= weight @ gain.T
        self.covariance = 0.5 * (self.covariance + self.covariance.T)
        self.count[landmark] += 1
        self._in_a_row = 0

    def _refuse(self, landmark: int) -> None:
        self._refused[landmark] += 1
        self._in_a_row += 1
        if self._in_a_row >= REJECTED_IN_A_ROW:
            self.covariance[:3, :3] += REOPENED_SIGMA**2 * np.eye(3)
            self._in_a_row = 0
        if self.count[landmark] <= DOUBTED_SIGHTINGS and self._refused[landmark] >= DOUBTED_REJECTIONS:
            rows = slice(3 + 2 * landmark, 5 + 2 * landmark)
            self.covariance[rows], self.covariance[:, rows] = 0.0, 0.0
            self.count[landmark] = self._refused[landmark] = 0


def local_map(delta: Floats, noise: Floats, sightings: KnownSightings, *, landmark_count: int) -> LocalMap:
    """The map of a drive that starts at the origin of its own frame.

    delta (n-1, 3): motions between keyframes, noise (n-1, 3, 3) their covariances, calibration's share included.
    """
    state = _Filter(landmark_count)
    pose = np.zeros((len(delta) + 1, 3))
    bounds = np.searchsorted(sightings.keyframe, np.arange(len(pose) + 1))
    for keyframe in range(len(pose)):
        if keyframe:
            state.move(delta[keyframe - 1], noise[keyframe - 1])
        for row in range(bounds[keyframe], bounds[keyframe + 1]):
            state.see(
                int(sightings.landmark[row]),
                float(sightings.ln_range[row]),
                float(sightings.bearing_rad[row]),
                sightings.T_keyframe_sensor[row],
            )
        pose[keyframe] = state.x[:3]
    return LocalMap(pose=pose, landmark_m=state.x[3:].reshape(-1, 2).copy(), count=state.count)

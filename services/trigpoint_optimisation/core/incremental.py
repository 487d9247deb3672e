"""The factor graph that grows with the drives: solved anew where a keyframe touches it, only there (Kaess et al. 2012).

All its factors are gtsam's own: odometry comes at the calibration learned beside it, so that no state is shared by
thousands of factors and an update stays short.
"""

import math
from collections.abc import Sequence

import gtsam
import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import ServiceError
from trigpoint_optimisation.core.graph import with_kernel
from trigpoint_optimisation.core.state import fix_bias_key, landmark_key, pose_key
from trigpoint_optimisation.settings import FixSettings

Floats = NDArray[np.float64]

RELINEARISE_M, RELINEARISE_RAD = 3.0, 0.05  # an estimate that moved less keeps its linearisation: a map that moves
# as a whole keeps its shape, headings bend it
RELINEARISE_EVERY = 10  # updates between two looks at which moved more
WILDFIRE = 0.003  # changes smaller than this, in m and rad, are not passed on through the graph
ARM_SIGMA_M, ARM_SIGMA_RAD = 0.02, 0.01  # of the antenna on its keyframe
ARM_LEAST_M = 0.5  # a shorter arm has no usable bearing
DATUM_SHARE = 0.9  # of the best-known landmark's variance is common to all: none is surer than what they share


def datum_key() -> int:
    """The error (2,) that all landmarks of the solved map share: Point2."""
    return int(gtsam.symbol("d", 0))


def antenna_point_key(drive: int, keyframe: int) -> int:
    """Where the antenna was at a fix hung on a keyframe: Point2."""
    return int(gtsam.symbol("p", drive * 10**7 + keyframe))


def pass_point_key(number: int) -> int:
    """Where one pass sees a landmark: Point2."""
    return int(gtsam.symbol("t", number))


def _thresholds() -> gtsam.ISAM2ThresholdMap:
    """How much an estimate may move, by the letter of its key."""
    thresholds = gtsam.ISAM2ThresholdMap()
    thresholds.insert(("x", np.array([RELINEARISE_M, RELINEARISE_M, RELINEARISE_RAD])))
    for letter in "ldpgt":
        thresholds.insert((letter, np.full(2, RELINEARISE_M)))
    return thresholds


def _gaussian(covariance: Floats) -> gtsam.noiseModel.Base:
    return gtsam.noiseModel.Gaussian.Covariance(covariance)


class IncrementalGraph:
    """Drives' keyframes and landmarks. What is added waits for `update`; estimates of what waits are first guesses."""

    def __init__(self) -> None:
        parameters = gtsam.ISAM2Params()
        parameters.setOptimizationParams(gtsam.ISAM2GaussNewtonParams(WILDFIRE))
        parameters.setRelinearizeThreshold(_thresholds())
        parameters.relinearizeSkip = RELINEARISE_EVERY
        self._solver = gtsam.ISAM2(parameters)
        self._factors, self._guesses = gtsam.NonlinearFactorGraph(), gtsam.Values()
        self.pose_count = self._pass_points = 0

    def add_solved_landmarks(self, point_m: Floats, covariance_m2: Floats) -> None:
        """Landmarks 0 … l - 1 as a solve left them, (l, 2) with covariances (l, 2, 2), and an error in common."""
        if not len(point_m):
            return
        common = DATUM_SHARE * covariance_m2[int(np.trace(covariance_m2, axis1=1, axis2=2).argmin())]
        self._factors.add(gtsam.PriorFactorPoint2(datum_key(), np.zeros(2), _gaussian(common)))
        self._guesses.insert(datum_key(), np.zeros(2))
        floor = (1.0 - DATUM_SHARE) * 0.5 * float(np.trace(common)) * np.eye(2)
        for number, (point, covariance) in enumerate(zip(point_m, covariance_m2, strict=True)):
            noise = _gaussian(_at_least(covariance - common, floor))
            self._factors.add(gtsam.BetweenFactorPoint2(datum_key(), landmark_key(number), point, noise))
            self._guesses.insert(landmark_key(number), point)

    def add_start(self, drive: int, keyframe: int, pose: Floats, covariance: Floats) -> None:
        """A drive's first keyframe in the map: pose (3,) with covariance (3, 3), x and y in m, map, heading in rad."""
        guess = gtsam.Pose2(*pose)
        turn = np.eye(3)
        turn[:2, :2] = guess.rotation().matrix()
        noise = _gaussian(turn.T @ covariance @ turn)
        self._factors.add(gtsam.PriorFactorPose2(pose_key(drive, keyframe), guess, noise))
        self._guesses.insert(pose_key(drive, keyframe), guess)
        self.pose_count += 1

    def add_motion(self, drive: int, keyframe: int, delta: Floats, covariance: Floats) -> None:
        """The next keyframe, `delta` (3,) with covariance (3, 3) from this one."""
        here, there, motion = pose_key(drive, keyframe), pose_key(drive, keyframe + 1), gtsam.Pose2(*delta)
        self._factors.add(gtsam.BetweenFactorPose2(here, there, motion, _gaussian(covariance)))
        self._guesses.insert(there, self._pose(here).compose(motion))
        self.pose_count += 1

    def add_landmark(self, landmark: int, point_m: Floats) -> None:
        """A landmark that was not there yet, about here (2,); its sightings hold it."""
        self._guesses.insert(landmark_key(landmark), point_m)

    def add_pass_point(self, landmark: int, shared_m2: float) -> int:
        """A point of one pass's own, off its landmark by the error that the pass's sightings share, of this variance
        per axis; its key."""
        key = pass_point_key(self._pass_points)
        self._pass_points += 1
        shared = gtsam.noiseModel.Isotropic.Variance(2, shared_m2)
        self._factors.add(gtsam.BetweenFactorPoint2(landmark_key(landmark), key, np.zeros(2), shared))
        self._guesses.insert(key, self.point(landmark))
        return key

    def add_sighting(self, drive: int, keyframe: int, key: int, point_m: Floats, covariance: Floats) -> None:
        """A landmark, or a pass's point of it, by its key, at a point (2,) of the keyframe's frame, not nearer than
        0.2 m, with covariance (2, 2)."""
        x, y = point_m.tolist()
        range_m = math.hypot(x, y)
        polar = np.array([[-y / range_m**2, x / range_m**2], [x / range_m, y / range_m]])
        noise = _gaussian(polar @ covariance @ polar.T)
        bearing = gtsam.Rot2(math.atan2(y, x))
        self._factors.add(gtsam.BearingRangeFactor2D(pose_key(drive, keyframe), key, bearing, range_m, noise))

    def add_fix_error(self, drive: int, knot: int, *, sigma_m: float, decay: float) -> None:
        """The slow error of a drive's fixes from a knot on, Gauss-Markov: stationary `sigma_m`, `decay` per knot."""
        key = fix_bias_key(drive, knot)
        own = sigma_m * math.sqrt(1.0 + decay) if not knot else sigma_m * math.sqrt((1.0 + decay) / (1.0 - decay))
        self._factors.add(gtsam.PriorFactorPoint2(key, np.zeros(2), gtsam.noiseModel.Isotropic.Sigma(2, own)))
        self._guesses.insert(key, np.zeros(2))
        if knot:
            step = gtsam.noiseModel.Isotropic.Sigma(2, sigma_m * math.sqrt((1.0 - decay**2) / decay))
            self._factors.add(gtsam.BetweenFactorPoint2(fix_bias_key(drive, knot - 1), key, np.zeros(2), step))

    def add_fix(
        self, drive: int, keyframe: int, knot: int, fix_m: Floats, *, antenna_m: Floats, fixes: FixSettings
    ) -> None:
        """A fix (2,) in the map of the antenna at (2,) in the keyframe's frame, under the slow error of a knot; of
        one keyframe at most one."""
        pose = self.pose(drive, keyframe)
        c, s = math.cos(pose[2]), math.sin(pose[2])
        turn = np.array([[c, -s], [s, c]])
        arm = antenna_m
        if math.hypot(*arm) < ARM_LEAST_M:  # a point ahead instead, and the fix moved with it
            arm = antenna_m + np.array([2.0 * ARM_LEAST_M, 0.0])
            fix_m = fix_m + turn @ (arm - antenna_m)
        key, range_m = antenna_point_key(drive, keyframe), math.hypot(*arm)
        noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([ARM_SIGMA_RAD, ARM_SIGMA_M]))
        bearing = gtsam.Rot2(math.atan2(arm[1], arm[0]))
        self._factors.add(gtsam.BearingRangeFactor2D(pose_key(drive, keyframe), key, bearing, range_m, noise))
        white = with_kernel(gtsam.noiseModel.Isotropic.Sigma(2, fixes.sigma_m), fixes.kernel)
        self._factors.add(gtsam.BetweenFactorPoint2(fix_bias_key(drive, knot), key, fix_m, white))
        self._guesses.insert(key, pose[:2] + turn @ arm)

    def update(self) -> None:
        """Everything added is solved for. Raises ServiceError where it leaves a state undetermined."""
        if not (self._factors.size() or self._guesses.size()):
            return
        try:
            self._solver.update(self._factors, self._guesses)
        except RuntimeError as error:  # gtsam names the state, not the cause; a restart begins from the last version
            raise ServiceError(f"{self.pose_count} poses cannot be solved for: {error}") from error
        self._factors, self._guesses = gtsam.NonlinearFactorGraph(), gtsam.Values()

    def pose(self, drive: int, keyframe: int) -> Floats:
        """A keyframe's pose (3,): x, y in m, heading in rad, map frame."""
        pose = self._pose(pose_key(drive, keyframe))
        return np.array([pose.x(), pose.y(), pose.theta()])

    def _pose(self, key: int) -> gtsam.Pose2:
        if self._guesses.exists(key):
            return self._guesses.atPose2(key)
        return self._solver.calculateEstimatePose2(key)

    def point(self, landmark: int) -> Floats:
        """A landmark's position (2,) in the map."""
        key = landmark_key(landmark)
        if self._guesses.exists(key):
            guess: Floats = self._guesses.atPoint2(key)
            return guess
        point: Floats = self._solver.calculateEstimatePoint2(key)
        return point

    def pose_covariance(self, drive: int, keyframe: int) -> Floats:
        """Covariance (3, 3) of a keyframe updated before, in the map frame: x, y in m, heading in rad."""
        covariance = self._solver.marginalCovariance(pose_key(drive, keyframe))
        heading = self.pose(drive, keyframe)[2]
        c, s = math.cos(heading), math.sin(heading)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        turned: Floats = turn @ covariance @ turn.T
        return turned

    def landmark_covariances(self, landmarks: Sequence[int]) -> Floats:
        """Covariances (l, 2, 2) in m^2 of landmarks updated before: of many asked for together nearly as soon as of
        one."""
        if not landmarks:
            return np.zeros((0, 2, 2))
        keys = [landmark_key(landmark) for landmark in landmarks]
        joint = self._solver.jointMarginalCovariance(keys).fullMatrix()
        blocks: Floats = np.array([joint[at : at + 2, at : at + 2] for at in range(0, 2 * len(keys), 2)])
        return blocks

    def seen_from(self, drive: int, keyframe: int, landmarks: Sequence[int]) -> tuple[Floats, Floats]:
        """Where landmarks (l) must be seen from a keyframe (l, 2), in its frame, and with which covariances (l, 2, 2):
        what the graph knows of the two together. All updated before."""
        if not landmarks:
            return np.zeros((0, 2)), np.zeros((0, 2, 2))
        keys = [pose_key(drive, keyframe), *(landmark_key(landmark) for landmark in landmarks)]
        joint = self._solver.jointMarginalCovariance(keys).fullMatrix()
        pose = self.pose(drive, keyframe)
        c, s = math.cos(pose[2]), math.sin(pose[2])
        turn = np.array([[c, s], [-s, c]])  # map to keyframe
        expected = np.array([turn @ (self.point(landmark) - pose[:2]) for landmark in landmarks])
        covariance = np.empty((len(landmarks), 2, 2))
        for row, (x, y) in enumerate(expected):
            by_pose = np.array([[-1.0, 0.0, y], [0.0, -1.0, -x]])  # gtsam's increments are in the body frame
            rows = np.r_[0:3, 3 + 2 * row : 5 + 2 * row]
            by_both = np.hstack([by_pose, turn])
            covariance[row] = by_both @ joint[np.ix_(rows, rows)] @ by_both.T
        return expected, covariance


def _at_least(covariance: Floats, floor: Floats) -> Floats:
    """The covariance (2, 2) with no direction surer than the floor."""
    values, vectors = np.linalg.eigh(covariance - floor)
    lifted: Floats = vectors @ np.diag(np.maximum(values, 0.0)) @ vectors.T + floor
    return lifted

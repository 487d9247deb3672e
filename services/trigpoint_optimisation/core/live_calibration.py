"""A drive's odometry calibration, learned as it goes from what stands still: the vehicle, and the things it sees."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.poses import transform_points, wrap_angle_rad
from trigpoint_optimisation.core.alignment import weighted_rigid

Floats = NDArray[np.float64]

MIN_SHARED = 3  # things seen from both keyframes that a motion is measured by
SPAN_M = 20.0  # path between the two keyframes: things are in sight for some 40 m
GATE = 16.27  # chi-square, 3 degrees of freedom, 99.9 %
CORRELATED_S = 60.0  # for so long the error of what was learned stays the same: as in the batch's turn bias knots
MAX_RESIDUAL_M = 0.4  # RMS, of things that stood still


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A motion by dead reckoning at the calibration `reference` (4,): delta (3,), derivative (3, 4) by speed scale,
    turn scale, delay, turn bias, and the covariance (3, 3) of its random part."""

    delta: Floats
    derivative: Floats
    covariance: Floats

    def then(self, other: "Motion") -> "Motion":
        """This motion followed by another."""
        c, s = np.cos(self.delta[2]), np.sin(self.delta[2])
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        step = turn @ other.delta
        by_first = np.array([[1.0, 0.0, -step[1]], [0.0, 1.0, step[0]], [0.0, 0.0, 1.0]])
        return Motion(
            delta=self.delta + step,
            derivative=by_first @ self.derivative + turn @ other.derivative,
            covariance=by_first @ self.covariance @ by_first.T + turn @ other.covariance @ turn.T,
        )

    def at(self, off: Floats) -> Floats:
        """The motion (3,) at a calibration `off` (4,) from the reference."""
        delta: Floats = self.delta + self.derivative @ off
        return delta


STANDING = Motion(delta=np.zeros(3), derivative=np.zeros((3, 4)), covariance=np.zeros((3, 3)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Speed scale, turn scale, delay, turn bias: how far off (4,) the reference they are, with covariance (4, 4)."""

    off: Floats
    covariance: Floats

    def corrected(self, motion: Motion, measured: Floats, covariance: Floats) -> "Calibration":
        """The calibration after a motion was measured (3,) with covariance (3, 3); beyond belief, it stays."""
        residual = measured - motion.at(self.off)
        residual[2] = wrap_angle_rad(float(residual[2]))
        spread = motion.derivative @ self.covariance @ motion.derivative.T + motion.covariance + covariance
        if residual @ np.linalg.solve(spread, residual) > GATE:
            return self
        gain = np.linalg.solve(spread, motion.derivative @ self.covariance).T
        left = self.covariance - gain @ motion.derivative @ self.covariance
        return Calibration(off=self.off + gain @ residual, covariance=0.5 * (left + left.T))

    def noise_of(self, motion: Motion, *, dt_s: float) -> Floats:
        """Covariance (3, 3) of a motion of `dt_s` at this calibration, whose error stays the same from motion to
        motion for long: motions taken as independent must each claim so much less."""
        longer = max(2.0 * CORRELATED_S / max(dt_s, 1e-3), 1.0)
        noise: Floats = motion.covariance + longer * motion.derivative @ self.covariance @ motion.derivative.T
        return noise


Points = Mapping[int, Floats]


def relative_motion(before: Points, after: Points, *, sigma_m: float) -> tuple[Floats, Floats] | None:
    """The motion (3,) between two keyframes by things seen from both, by track number, with its covariance (3, 3);
    None where they are too few or did not stand still."""
    shared = sorted(before.keys() & after.keys())
    if len(shared) < MIN_SHARED:
        return None
    a, b = np.array([before[n] for n in shared]), np.array([after[n] for n in shared])
    found = weighted_rigid(b, a, np.ones(len(shared)))
    motion = np.array([found.x_m, found.y_m, found.heading_rad])
    left = a - transform_points(motion, b)
    if float(np.sqrt((left**2).sum(axis=1).mean())) > MAX_RESIDUAL_M:
        return None
    centre, spread = a.mean(axis=0), float(((a - a.mean(axis=0)) ** 2).sum())
    heading = 2.0 * sigma_m**2 / max(spread, 1.0)
    arm = np.array([-(motion[1] - centre[1]), motion[0] - centre[0], 1.0])  # by heading, at the later origin
    covariance = heading * np.outer(arm, arm) + np.diag([*([2.0 * sigma_m**2 / len(shared)] * 2), 0.0])
    return motion, covariance


class Calibrating:
    """Learns a calibration from motions and what is seen at their ends."""

    def __init__(self, calibration: Calibration, *, sigma_m: float, bias_walk: float) -> None:
        """`sigma_m` of a thing seen, per axis; `bias_walk` of the turn bias, per sqrt(s)."""
        self.calibration = calibration
        self._sigma_m, self._walk = sigma_m, np.array([0.0, 0.0, 0.0, bias_walk])
        self._anchor: Points = {}
        self._motion = STANDING

    def take(self, motion: Motion, seen: Points, *, dt_s: float, standing: bool) -> None:
        """One more motion, standing or not, and what is seen at its start."""
        covariance = self.calibration.covariance + np.diag(self._walk**2 * dt_s)
        self.calibration = replace(self.calibration, covariance=covariance)
        reached_m = float(np.hypot(*self._motion.delta[:2]))
        if reached_m >= SPAN_M or not self._anchor:
            found = relative_motion(self._anchor, seen, sigma_m=self._sigma_m)
            if found is not None:
                self.calibration = self.calibration.corrected(self._motion, *found)
            self._anchor, self._motion = seen, STANDING
        if standing:
            still = replace(motion, covariance=motion.covariance + 1e-8 * np.eye(3))
            self.calibration = self.calibration.corrected(still, np.zeros(3), np.zeros((3, 3)))
        self._motion = self._motion.then(motion)

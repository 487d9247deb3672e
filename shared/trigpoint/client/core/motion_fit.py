"""One motion fitted to the landmarks it lays upon each other, and how likely it is beside all being clutter."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.client.core.constellations import Constellation, same_kind
from trigpoint.geodesy.poses import transform_points

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CHI_SQUARE_LIMIT = 13.8  # of a residual, 2 degrees of freedom, 99.9 %
MATCHED_LEAST = 3  # landmarks: two fit by construction
ROUNDS = 8
SETTLED = 1e-4  # metres and radians


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionPrior:
    """Where the base is before any landmark: point_m (2,) in the map, its 1-sigma along each axis, and what is known
    of the heading, None for nothing."""

    point_m: Floats
    sigma_m: float
    heading_rad: float | None = None
    heading_sigma_rad: float = math.inf

    @property
    def mean(self) -> Floats:
        """x, y in m and heading in rad (3,); heading 0 where nothing is known of it."""
        return np.array([*self.point_m, self.heading_rad or 0.0])

    @property
    def information(self) -> Floats:
        """The inverse covariance (3, 3)."""
        turn = 0.0 if self.heading_rad is None else self.heading_sigma_rad**-2
        return np.diag([self.sigma_m**-2, self.sigma_m**-2, turn])

    @property
    def log_peak(self) -> float:
        """The logarithm of its density at its mean; of a heading of which nothing is known all are alike."""
        turn = math.sqrt(2.0 * math.pi) * self.heading_sigma_rad
        wide = 2.0 * math.pi if self.heading_rad is None else min(turn, 2.0 * math.pi)
        return -math.log(2.0 * math.pi * self.sigma_m**2) - math.log(wide)

    def off(self, motions: Floats) -> Floats:
        """How far motions (..., 3) are from the mean, the shorter way round."""
        off: Floats = motions - self.mean
        off[..., 2] = (off[..., 2] + math.pi) % (2.0 * math.pi) - math.pi
        return off

    def chi_square(self, motions: Floats) -> Floats:
        """The squared Mahalanobis distance (...) of motions (..., 3)."""
        off = self.off(motions)
        return np.asarray(np.einsum("...i,ij,...j->...", off, self.information, off))


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedMotion:
    """A motion T_map_base (3,) with covariance (3, 3), the pairs (k, 2) of observed and known landmarks it rests on,
    their squared Mahalanobis distances' sum, and the logarithm of its evidence against all being clutter."""

    motion: Floats
    covariance: Floats
    pairs: Ints
    chi_square: float
    log_evidence: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation:
    """How many things are observed that are in no map, per m^2, and the share of mapped landmarks observed."""

    clutter_per_m2: float
    detected: float

    def gain(self, chi_square: Floats, determinant_m4: Floats) -> Floats:
        """The log-likelihood ratio of a residual being a landmark's and not clutter's, any shape."""
        peak = self.detected / (2.0 * math.pi * self.clutter_per_m2) / np.sqrt(determinant_m4)
        gain: Floats = np.log(peak) - 0.5 * chi_square
        return gain


def fitted_motion(
    motion: Floats, observed: Constellation, known: Constellation, prior: PositionPrior, expected: Expectation
) -> FittedMotion | None:
    """The motion (3,) after pairing and fitting in turn (Gauss-Newton on the robust posterior, evidence by Laplace);
    None where fewer landmarks than `MATCHED_LEAST` fit."""
    alike = same_kind(observed, known)
    motion = motion.copy()
    for _ in range(ROUNDS):
        residual_m, innovation_m2 = _residuals(motion, observed, known)
        chi_square, determinant_m4 = _distances(residual_m, innovation_m2)
        gain = np.where(alike & (chi_square < CHI_SQUARE_LIMIT), expected.gain(chi_square, determinant_m4), 0.0)
        pairs = _one_to_one(gain)
        if len(pairs) < MATCHED_LEAST:
            return None
        information, gradient = _normal_equations(motion, observed, residual_m, innovation_m2, pairs=pairs)
        information = information + prior.information
        step = np.linalg.solve(information, gradient - prior.information @ prior.off(motion))
        motion = motion + step
        if np.abs(step).max() < SETTLED:
            break
    covariance = np.linalg.inv(information)
    a, b = pairs.T
    spread = 0.5 * np.linalg.slogdet(2.0 * math.pi * covariance)[1]
    before = prior.log_peak - 0.5 * float(prior.chi_square(motion))
    return FittedMotion(
        motion=motion,
        covariance=0.5 * (covariance + covariance.T),
        pairs=pairs,
        chi_square=float(chi_square[a, b].sum()),
        log_evidence=float(gain[a, b].sum()) + float(spread) + before,
    )


def _residuals(motion: Floats, observed: Constellation, known: Constellation) -> tuple[Floats, Floats]:
    """Known minus observed (n, m, 2) in the map, and its covariance (n, m, 2, 2)."""
    c, s = math.cos(motion[2]), math.sin(motion[2])
    turn = np.array([[c, -s], [s, c]])
    turned_m2 = turn @ observed.covariance_m2 @ turn.T
    seen_m = transform_points(motion, observed.point_m)
    return known.point_m - seen_m[:, None], turned_m2[:, None] + known.covariance_m2


def _distances(residual_m: Floats, covariance_m2: Floats) -> tuple[Floats, Floats]:
    """Squared Mahalanobis distances and determinants of 2 x 2 covariances, of all pairs at once."""
    xx, xy, yy = covariance_m2[..., 0, 0], covariance_m2[..., 0, 1], covariance_m2[..., 1, 1]
    x, y = residual_m[..., 0], residual_m[..., 1]
    determinant = xx * yy - xy**2
    return (x**2 * yy - 2.0 * x * y * xy + y**2 * xx) / determinant, determinant


def _one_to_one(gain: Floats) -> Ints:
    """Pairs (k, 2) of positive gain, the largest first; each row and column once."""
    rows, columns = np.nonzero(gain > 0.0)
    order = np.argsort(-gain[rows, columns], kind="stable")
    used_rows, used_columns, pairs = set[int](), set[int](), []
    for a, b in zip(rows[order].tolist(), columns[order].tolist(), strict=True):
        if a not in used_rows and b not in used_columns:
            used_rows.add(a)
            used_columns.add(b)
            pairs.append((a, b))
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _normal_equations(
    motion: Floats, observed: Constellation, residual_m: Floats, innovation_m2: Floats, *, pairs: Ints
) -> tuple[Floats, Floats]:
    """J' W J (3, 3) and J' W r (3,) of the paired landmarks."""
    a, b = pairs.T
    turned_m = transform_points(np.array([0.0, 0.0, motion[2]]), observed.point_m[a])
    jacobian = np.zeros((len(a), 2, 3))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0
    jacobian[:, 0, 2], jacobian[:, 1, 2] = -turned_m[:, 1], turned_m[:, 0]
    weighted = np.linalg.solve(innovation_m2[a, b], jacobian)
    information = np.einsum("kij,kil->jl", jacobian, weighted)
    gradient = np.einsum("kij,ki->j", weighted, residual_m[a, b])
    return information, gradient

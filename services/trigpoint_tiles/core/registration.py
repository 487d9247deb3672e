"""Where an aerial image shows the ground beside where the ortho layer has it: shift, lean, sigma and confidence.

The image's objects lean: what stands h above the ground is displaced by h times the view's slant, unless the provider
made a true orthophoto. Shift and lean are estimated together, each pixel of the layer by its height, so that roofs do
not bend what is said of the ground.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, optimize, stats
from scipy.interpolate import RectBivariateSpline

from trigpoint.errors import InputError
from trigpoint_tiles.core.agreement import agreements
from trigpoint_tiles.core.gradient_directions import edge_directions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SMOOTHING_PX = 1.0  # 1-sigma; finer edges are noise, coarser ones shadows and crowns of trees
REACH_M, REACH_MOST_M = 3.0, 12.0  # searched unless more is asked for, and what can be: a street looks like the next
BLOCK_M = 10.0  # what is in one block counts as one observation: about a street's width, along which edges go on
HEIGHTS_M = (1.0, 2.5, 4.0, 6.0, 9.0, 14.0)  # between heights that are taken as one
LEAN_SIGMA = 0.1  # metres a metre of height; aerial cameras see 0 to 0.3, mosaics use the middle of their images
LEAN_LIMIT = 0.4
RIVAL_PX = 4.0  # a maximum nearer than this belongs to the highest one
CONFIDENCE_LEAST = 0.95
BLOCKS_LEAST = 8
TILE_PX_LEAST = 24  # that stay inside the image at every shift


@dataclass(frozen=True, slots=True, kw_only=True)
class Registration:
    """Where an image shows the ground, less where the layer has it: `shift_m` (2,) east and north.

    covariance_m2 (2, 2) of the shift, from how the tile's blocks agree (so it holds what leans otherwise, moved or grew
    between the two pictures); `lean` (2,): metres east and north that a metre of height adds. `confidence`: the
    probability that no other place within the reach is as good. `refused`: why the shift is not to be used, else empty.
    """

    shift_m: Floats
    covariance_m2: Floats
    lean: Floats
    confidence: float
    refused: str = ""

    @property
    def sigma_m(self) -> tuple[float, float]:
        """1-sigma east and north."""
        east, north = np.sqrt(np.diag(self.covariance_m2))
        return float(east), float(north)


def registered(
    layers: Sequence[Floats],
    height_above_m: Floats,
    image: Sequence[Floats],
    *,
    pixel_m: float,
    reach_m: float = REACH_M,
) -> Registration:
    """An image's bands (h, w) on an ortho layer's (h, w), north up on the same pixels, NaN where nothing is known.

    height_above_m (h, w): height above ground, NaN counts as ground. Shifts of up to `reach_m` either way are searched,
    for what is farther than that from the edge. Raises InputError for a tile too small to shift.
    """
    shape = height_above_m.shape
    reach_px = round(reach_m / pixel_m)
    least = TILE_PX_LEAST + 2 * reach_px
    if min(shape) < least:
        raise InputError(f"a tile of {shape[1]} x {shape[0]} pixels is too small to register: at least {least} a side")
    fixed = edge_directions(layers, sigma_px=SMOOTHING_PX)
    moved = edge_directions(image, sigma_px=SMOOTHING_PX)
    bins, height_m = _height_bins(height_above_m)
    blocks = _blocks(shape, round(BLOCK_M / pixel_m))
    group = blocks * len(height_m) + bins
    count = (int(blocks.max()) + 1) * len(height_m)
    found = agreements(fixed, moved, group=group, groups=count, reach_px=reach_px)
    side = 2 * reach_px + 1
    surfaces = found.reshape(-1, len(height_m), side, side)
    surfaces = surfaces[np.any(surfaces != 0.0, axis=(1, 2, 3))]
    if len(surfaces) < BLOCKS_LEAST:
        return unknown(f"{len(surfaces)} blocks of {BLOCK_M:g} m show edges in both: at least {BLOCKS_LEAST}")
    return _Fit(surfaces, height_m, pixel_m).registration()


def unknown(reason: str) -> Registration:
    """A registration that tells nothing, and why."""
    nothing = np.full(2, np.nan)
    return Registration(
        shift_m=nothing, covariance_m2=np.full((2, 2), np.nan), lean=nothing, confidence=0.0, refused=reason
    )


def _height_bins(height_above_m: Floats) -> tuple[Ints, Floats]:
    """The number of each pixel's height, and the heights; an edge belongs to the higher of its sides."""
    level_m = ndimage.maximum_filter(np.maximum(np.nan_to_num(height_above_m), 0.0), size=3)
    bins = np.digitize(level_m, HEIGHTS_M)
    count = np.bincount(bins.ravel(), minlength=len(HEIGHTS_M) + 1)
    total = np.bincount(bins.ravel(), level_m.ravel(), minlength=len(HEIGHTS_M) + 1)
    return bins.astype(np.int64), total / np.maximum(count, 1)


def _blocks(shape: tuple[int, ...], side_px: int) -> Ints:
    rows, columns = (np.arange(length) // side_px for length in shape[:2])
    return np.asarray(rows[:, None] * (columns[-1] + 1) + columns[None, :], dtype=np.int64)


@dataclass(frozen=True, slots=True)
class _Surface:
    """The agreement at every shift, in px, of what is so high above the ground."""

    height_m: float
    spline: RectBivariateSpline

    def place(self, state: Floats) -> Floats:
        """Where (2,) it is read at a state (4,): shift in px, lean in px per m."""
        return np.asarray(state[:2] + self.height_m * state[2:])


class _Fit:
    """The shift and lean at which the blocks agree most. Rows and columns count pixels down and right."""

    def __init__(self, surfaces: Floats, height_m: Floats, pixel_m: float) -> None:
        """surfaces (b, k, side, side): blocks, heights (k,) in m."""
        self._surfaces, self._height_m, self._pixel_m = surfaces, height_m, pixel_m
        self._reach = surfaces.shape[-1] // 2
        self._axis = np.arange(-self._reach, self._reach + 1, dtype=np.float64)
        self._whole = self._splines(surfaces.sum(axis=0))
        self._blocks = [self._splines(block) for block in surfaces]

    def registration(self) -> Registration:
        """What the surfaces say."""
        total = self._surfaces.sum(axis=(0, 1))
        start = np.array(np.unravel_index(total.argmax(), total.shape), dtype=np.float64) - self._reach
        if np.abs(start).max() >= self._reach - 1:
            edge_m = self._reach * self._pixel_m
            return unknown(f"the best agreement is at the edge of the {edge_m:g} m that are searched")
        weight = self._likelihood_weight(np.array([*start, 0.0, 0.0]))
        best = self._optimum(start, weight)
        covariance_px2 = self._covariance(best, weight)
        down_right = np.array([[0.0, 1.0], [-1.0, 0.0]]) * self._pixel_m  # to east, north in m
        confidence = self._confidence(best)
        refused = "" if confidence >= CONFIDENCE_LEAST else f"confidence {confidence:.2f}: least {CONFIDENCE_LEAST:g}"
        return Registration(
            shift_m=down_right @ best[:2],
            covariance_m2=down_right @ covariance_px2[:2, :2] @ down_right.T,
            lean=down_right @ best[2:],
            confidence=confidence,
            refused=refused,
        )

    def _splines(self, surfaces: Floats) -> list[_Surface]:
        """The surfaces (k, side, side) that say anything, and their heights."""
        return [
            _Surface(float(height_m), RectBivariateSpline(self._axis, self._axis, surface))
            for height_m, surface in zip(self._height_m, surfaces, strict=True)
            if surface.any()
        ]

    def _gradient(self, surfaces: Sequence[_Surface], state: Floats) -> Floats:
        """The agreement's derivatives (4,) by the state."""
        total = np.zeros(4)
        for one in surfaces:
            place = one.place(state)
            slope = np.array([float(one.spline.ev(*place, dx=1)), float(one.spline.ev(*place, dy=1))])
            total += np.concatenate([slope, one.height_m * slope])
        return total

    def _curvature(self, state: Floats) -> Floats:
        """Minus the second derivatives (4, 4) of the whole agreement."""
        total = np.zeros((4, 4))
        for one in self._whole:
            height_m, spline, place = one.height_m, one.spline, one.place(state)
            across = float(spline.ev(*place, dx=1, dy=1))
            own = np.array([[float(spline.ev(*place, dx=2)), across], [across, float(spline.ev(*place, dy=2))]])
            total -= np.kron(np.array([[1.0, height_m], [height_m, height_m**2]]), own)
        return total

    def _block_gradients(self, state: Floats) -> Floats:
        return np.array([self._gradient(block, state) for block in self._blocks])

    def _likelihood_weight(self, state: Floats) -> float:
        """By how much the agreement weighs as a log-likelihood would (Pauli, Racugno and Ventura 2011)."""
        gradients = self._block_gradients(state)[:, :2]
        spread = np.cov(gradients.T) * len(gradients)
        return max(float(np.trace(self._curvature(state)[:2, :2]) / np.trace(spread)), 0.0)

    def _prior(self) -> Floats:
        return np.array([0.0, 0.0, 1.0, 1.0]) * (self._pixel_m / LEAN_SIGMA) ** 2

    def _optimum(self, start: Floats, weight: float) -> Floats:
        prior = self._prior()

        def cost(state: Floats) -> float:
            agreement = sum(float(one.spline.ev(*one.place(state))) for one in self._whole)
            return float(0.5 * prior @ state**2 - weight * agreement)

        def slope(state: Floats) -> Floats:
            return np.asarray(prior * state - weight * self._gradient(self._whole, state))

        lean = LEAN_LIMIT / self._pixel_m
        bounds = [*((at - RIVAL_PX, at + RIVAL_PX) for at in start), (-lean, lean), (-lean, lean)]
        found = optimize.minimize(cost, [*start, 0.0, 0.0], jac=slope, method="L-BFGS-B", bounds=bounds)
        return np.asarray(found.x, dtype=np.float64)

    def _covariance(self, state: Floats, weight: float) -> Floats:
        """Of the state (4, 4): the sandwich of curvature and the blocks' own gradients (Huber 1967; White 1982)."""
        gradients = weight * self._block_gradients(state)
        count = len(gradients)
        spread = np.cov(gradients.T) * count * count / (count - 4)
        prior = np.diag(self._prior())
        inverse = np.linalg.pinv(weight * self._curvature(state) + prior, hermitian=True)
        return np.asarray(inverse @ (spread + prior) @ inverse)

    def _confidence(self, state: Floats) -> float:
        """One less the chance that a rival maximum is as good, by the blocks' differences (paired t, Bonferroni)."""
        still = np.array([0.0, 0.0, *state[2:]])
        leant = np.zeros((len(self._blocks), len(self._axis), len(self._axis)))
        for block, surfaces in enumerate(self._blocks):
            for one in surfaces:
                down, right = one.place(still)
                leant[block] += one.spline(self._axis + down, self._axis + right)
        total = leant.sum(axis=0)
        here = np.array([sum(float(one.spline.ev(*one.place(state))) for one in block) for block in self._blocks])
        highest = ndimage.maximum_filter(total, size=3) == total
        away = np.hypot(self._axis[:, None] - state[0], self._axis[None, :] - state[1]) > RIVAL_PX
        rivals = np.argwhere(highest & away)
        lead = here[:, None] - leant[:, rivals[:, 0], rivals[:, 1]]
        error = lead.std(axis=0, ddof=1) / np.sqrt(len(lead))
        chance = stats.t.sf(lead.mean(axis=0) / np.maximum(error, np.finfo(np.float64).tiny), len(lead) - 1)
        return float(np.clip(1.0 - chance.sum(), 0.0, 1.0))

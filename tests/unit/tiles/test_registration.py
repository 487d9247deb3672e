"""An image's shift is found to a fraction of a pixel, with a sigma that holds, and refused where nothing tells it."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from trigpoint.errors import InputError
from trigpoint_tiles.core.registration import Registration, registered

Floats = NDArray[np.float64]

PIXEL_M, SIDE_PX, MARGIN_PX = 0.2, 240, 20
FINE = 2  # a pixel is drawn as so many a side


def scene(seed: int) -> tuple[Floats, Floats]:
    """Brightness and height above ground (m), FINE times as fine as the pixels, of roofs and painted ground."""
    random = np.random.default_rng(seed)
    side = (SIDE_PX + 2 * MARGIN_PX) * FINE
    bright, height_m = np.full((side, side), 0.5), np.zeros((side, side))
    down, right = np.mgrid[:side, :side]
    for number in range(70):
        middle, turn = random.uniform(0, side, 2), random.uniform(0, np.pi)
        half = random.uniform(6, 60, 2) * FINE / 4
        along = (right - middle[0]) * np.cos(turn) + (down - middle[1]) * np.sin(turn)
        across = (down - middle[1]) * np.cos(turn) - (right - middle[0]) * np.sin(turn)
        inside = (np.abs(along) < half[0]) & (np.abs(across) < half[1])
        bright[inside] = random.uniform(0, 1)
        height_m[inside] = 5.0 if number % 7 == 0 else 0.0
    return bright, height_m


def pixels(fine: Floats, shift_px: tuple[float, float]) -> Floats:
    """The middle of a scene on pixels, shown so many pixels east and north of where it is."""
    moved = ndimage.shift(fine, (-shift_px[1] * FINE, shift_px[0] * FINE), order=1, mode="nearest")
    binned = moved.reshape(SIDE_PX + 2 * MARGIN_PX, FINE, -1, FINE).mean(axis=(1, 3))
    return np.asarray(binned[MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX])


def registration(
    seed: int, shift_px: tuple[float, float], *, image_seed: int | None = None, noise: float = 0.05
) -> Registration:
    """A lidar's layer of a scene, with gaps, and a camera's picture of it (or of another), otherwise bright."""
    random = np.random.default_rng([seed, 7])
    bright, height_m = scene(seed)
    seen, above_m = (pixels(fine, (0.0, 0.0)) for fine in (bright, height_m))
    seen = seen + random.normal(0.0, noise, seen.shape)
    seen[random.random(seen.shape) < 0.3] = np.nan
    shown = pixels(scene(seed if image_seed is None else image_seed)[0], shift_px)
    image = [1.0 - shown**2, 0.3 + 0.5 * shown] + random.normal(0.0, noise, (2, *shown.shape))
    return registered([seen, above_m], above_m, list(image), pixel_m=PIXEL_M)


@pytest.mark.parametrize("shift_px", [(0.0, 0.0), (0.5, -0.3), (-3.7, 2.2), (6.4, 7.9)])
def test_a_known_shift_is_found_to_a_tenth_of_a_pixel(shift_px: tuple[float, float]) -> None:
    found = registration(1, shift_px)
    assert found.refused == ""
    assert np.abs(found.shift_m / PIXEL_M - shift_px).max() < 0.1


def test_sigma_holds_what_the_shifts_are_off() -> None:
    errors = []
    for seed in range(8):
        found = registration(seed, (1.3, -0.8), noise=0.2)
        off_m = found.shift_m - np.array([1.3, -0.8]) * PIXEL_M
        errors.append(float(off_m @ np.linalg.solve(found.covariance_m2, off_m)) / 2)
    # Of 8 x 2 squared standard scores the mean is 1; 0.2 to 2.8 leaves out less than one sample in a thousand.
    assert 0.2 < float(np.mean(errors)) < 2.8


@pytest.mark.parametrize("seed", range(2))
def test_pictures_of_different_ground_are_refused(seed: int) -> None:
    assert registration(seed, (0.0, 0.0), image_seed=seed + 100).refused != ""


@pytest.mark.parametrize("seed", range(2))
def test_noise_is_refused(seed: int) -> None:
    random = np.random.default_rng(seed)
    bright, height_m = scene(seed)
    noise = [ndimage.gaussian_filter(random.normal(size=(SIDE_PX, SIDE_PX)), 1.0) for _ in range(3)]
    above_m = pixels(height_m, (0.0, 0.0))
    found = registered([pixels(bright, (0.0, 0.0)), above_m], above_m, noise, pixel_m=PIXEL_M)
    assert found.refused != ""


def test_ground_of_one_colour_is_refused_with_the_reason() -> None:
    flat = np.ones((SIDE_PX, SIDE_PX))
    found = registered([flat, 0 * flat], 0 * flat, [flat], pixel_m=PIXEL_M)
    assert "0 blocks" in found.refused


def test_a_tile_that_cannot_be_shifted_is_refused_with_its_size_and_the_least() -> None:
    small = np.ones((30, 30))
    with pytest.raises(InputError, match="30 x 30 pixels .* at least 54"):
        registered([small, small], small, [small], pixel_m=PIXEL_M)

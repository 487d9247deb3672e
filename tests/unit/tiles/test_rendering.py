"""What a tile shows of several drives: balance, and things that moved."""

import numpy as np

from trigpoint_tiles.core.balance import STEPS_PER_OCTAVE, balanced_gains, brightness
from trigpoint_tiles.core.cells import (
    FIELDS,
    GROUND_COUNT,
    GROUND_HEIGHT_MM,
    GROUND_INTENSITY,
    GROUND_SWEEPS,
    INTENSITY_STEPS,
    LOW_COUNT,
    LOW_HIGHEST,
    LOW_INTENSITY,
    LOW_SWEEPS,
    VARIANCE_MM2,
    ZERO_MM,
    Cells,
)
from trigpoint_tiles.core.pictures import from_farther, picture
from trigpoint_tiles.core.rendering import DENSITY_PER_M2, HEIGHT_ABOVE_M, REFLECTIVITY, SIGMA_M, rendered, stands


def cells_with(**fields: int) -> Cells:
    """One cell of these fields."""
    cells = np.zeros((1, 1, FIELDS), dtype=np.int64)
    for name, value in fields.items():
        cells[0, 0, FIELD[name]] = value
    return cells


FIELD = {
    "ground": GROUND_COUNT,
    "ground_intensity": GROUND_INTENSITY,
    "ground_mm": GROUND_HEIGHT_MM,
    "bare_sweeps": GROUND_SWEEPS,
    "low": LOW_COUNT,
    "low_intensity": LOW_INTENSITY,
    "low_highest": LOW_HIGHEST,
    "low_sweeps": LOW_SWEEPS,
    "variance_mm2": VARIANCE_MM2,
}
STEP = int(INTENSITY_STEPS)
PARKED = cells_with(low=10, low_intensity=900 * STEP, low_highest=ZERO_MM + 1500, low_sweeps=10, variance_mm2=250_000)
BARE = cells_with(ground=10, ground_intensity=100 * STEP, bare_sweeps=10, variance_mm2=250_000)


def test_what_one_drive_of_three_saw_standing_is_faded() -> None:
    bands = rendered([PARKED, BARE, BARE], [1.0, 1.0, 1.0], pixel_area_m2=0.01)
    assert bands[HEIGHT_ABOVE_M, 0, 0] == 0.0
    assert bands[REFLECTIVITY, 0, 0] == 10.0


def test_what_most_drives_saw_standing_stays() -> None:
    bands = rendered([PARKED, PARKED, BARE], [1.0, 1.0, 1.0], pixel_area_m2=0.01)
    assert bands[HEIGHT_ABOVE_M, 0, 0] == 1.5
    assert bands[REFLECTIVITY, 0, 0] == np.float32((900 + 900 + 100) / 30)


def test_what_passed_while_one_drive_looked_is_faded() -> None:
    passing = cells_with(
        ground=50, ground_intensity=500 * STEP, bare_sweeps=9, low=5, low_intensity=450 * STEP, low_sweeps=2
    )
    assert not stands([passing]).any()


def test_a_wall_in_every_drive_stands_whatever_their_number() -> None:
    assert stands([PARKED]).all()
    assert stands([PARKED] * 4).all()


def test_sigma_is_the_root_mean_square_of_the_points_and_density_counts_what_is_shown() -> None:
    bands = rendered([BARE], [1.0], pixel_area_m2=0.04)
    assert bands[SIGMA_M, 0, 0] == np.float32(np.sqrt(25_000) / 1000)
    assert bands[DENSITY_PER_M2, 0, 0] == 250.0


def test_where_nothing_was_seen_every_band_is_nan() -> None:
    assert np.isnan(rendered([np.zeros_like(BARE)], [1.0], pixel_area_m2=0.01)).all()


def test_a_drive_twice_as_bright_is_made_half_as_bright() -> None:
    random = np.random.default_rng(2)
    dark = np.zeros((16, 16, FIELDS), dtype=np.int64)
    dark[..., GROUND_COUNT] = 4
    dark[..., GROUND_INTENSITY] = random.integers(20, 90, (16, 16)) * 4 * STEP
    bright = dark.copy()
    bright[..., GROUND_INTENSITY] *= 2
    gains = balanced_gains([brightness([("a", dark), ("b", bright)])])
    # Gains are rounded to steps of 1/64 octave; the drives' own means pull by 1 in 257.
    assert abs(np.log2(gains["a"] / gains["b"]) - 1.0) <= 1.0 / STEPS_PER_OCTAVE + 2.0 / 257


def test_drives_balanced_through_a_third_one_agree() -> None:
    ground = np.zeros((8, 8, FIELDS), dtype=np.int64)
    ground[..., GROUND_COUNT], ground[..., GROUND_INTENSITY] = 4, 40 * STEP
    thrice, fifth = ground.copy(), ground.copy()
    thrice[..., GROUND_INTENSITY] *= 3
    fifth[..., GROUND_INTENSITY] //= 5
    tiles = [brightness([("a", ground), ("b", thrice)]), brightness([("b", thrice), ("c", fifth)])]
    gains = balanced_gains(tiles)
    assert abs(np.log2(gains["a"] / (3 * gains["b"]))) < 0.05
    assert abs(np.log2(3 * gains["b"] * 5 / gains["c"])) < 2.0  # clipped at two octaves a cell: 15 is 3.9


def test_a_picture_is_clear_where_nothing_was_seen_and_middle_grey_on_usual_ground() -> None:
    bands = np.full((5, 256, 256), np.nan, dtype=np.float32)
    bands[REFLECTIVITY, 10, 20] = 1.0
    shown = picture(bands)
    assert shown[10, 20].tolist() == [128, 255]
    assert int(shown[..., 1].astype(int).sum()) == 255


def test_from_farther_a_pixel_is_the_mean_of_the_four_and_as_clear() -> None:
    child = np.zeros((256, 256, 2), dtype=np.uint8)
    child[0, 0], child[0, 1] = (100, 255), (50, 255)
    parent = from_farther({(1, 0): child})
    assert parent[0, 128].tolist() == [75, 128]
    assert int(parent[..., 1].astype(int).sum()) == 128

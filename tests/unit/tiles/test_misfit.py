"""The measure of a picture beside points, on spots that are painted by hand."""

import numpy as np
import pytest
from numpy.typing import NDArray

from raster_readers.misfit import places_in, worst_px

PLACES = np.array([[20.3, 30.7], [60.5, 25.25]])
RADIUS_PX = 12.0


def painted(off_px: tuple[float, float]) -> NDArray[np.float64]:
    """A picture (64, 96) of soft spots so far, in columns and rows, from the places."""
    row, column = np.indices((64, 96)) + 0.5
    spots = [np.exp(-(np.hypot(column - at[0] - off_px[0], row - at[1] - off_px[1]) ** 2) / 18.0) for at in PLACES]
    return np.asarray(40.0 + 200.0 * np.sum(spots, axis=0), dtype=np.float64)


@pytest.mark.parametrize("off_px", [(0.0, 0.0), (0.75, 0.0), (-0.3, 0.4)])
def test_a_shift_of_the_picture_is_what_is_measured(off_px: tuple[float, float]) -> None:
    # A hundredth of a pixel: the spot's tail that the window cuts off.
    assert worst_px(painted(off_px), PLACES, radius_px=RADIUS_PX) == pytest.approx(np.hypot(*off_px), abs=0.02)


def test_the_drawn_points_are_found_where_they_were_drawn() -> None:
    found = places_in(painted((0.0, 0.0)), count=2)
    assert found[np.argsort(found[:, 0])] == pytest.approx(PLACES, abs=0.2)


def test_points_that_are_not_drawn_are_missed_and_a_dark_picture_is_no_match() -> None:
    with pytest.raises(AssertionError, match="2 points are drawn, 3 should be"):
        places_in(painted((0.0, 0.0)), count=3)
    with pytest.raises(AssertionError, match="nothing bright"):
        worst_px(np.zeros((64, 96)), PLACES, radius_px=RADIUS_PX)

"""What is gathered in each cell of a grid: whole numbers, so that any order of gathering gives the very same result.

A cell is FIELDS numbers, all 0 where nothing was seen; partial cells of the same drive are merged by adding, but for
the extremes (of which the greater one is kept). Lengths are whole millimetres, intensities whole 1/1024 of the
sensor's unit. The ground's numbers stand first: one cache line.
"""

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[np.int64]

(
    GROUND_COUNT,
    GROUND_INTENSITY,
    GROUND_HEIGHT_MM,
    GROUND_LOWEST,  # ZERO_MM less the height
    VARIANCE_MM2,  # of the position per axis, of all points
    GROUND_SWEEPS,  # sweeps that saw the ground here and nothing on it
    GROUND_LAST,  # the newest sweep among them, while gathering
    LOW_LAST,
    LOW_COUNT,
    LOW_INTENSITY,
    LOW_HIGHEST,  # ZERO_MM and the height
    LOW_SWEEPS,  # sweeps that saw something on the ground here
    HIGH_COUNT,
    HIGH_INTENSITY,
    HIGH_HIGHEST,
    ABOVE_HEIGHT_MM,  # of low and high points
) = range(16)
FIELDS = 16
EXTREMES = (GROUND_LOWEST, LOW_HIGHEST, HIGH_HIGHEST)
WHILE_GATHERING = (GROUND_LAST, LOW_LAST)
ZERO_MM = 1_000_000  # heights within a kilometre of the ground under the vehicle
INTENSITY_STEPS = 1024.0
MM = 1000.0

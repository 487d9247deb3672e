"""How well two fields of edge directions agree at every shift of one against the other, group by group."""

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Complexes = NDArray[np.complex128]


def agreements(fixed: Complexes, moved: Complexes, *, group: Ints, groups: int, reach_px: int) -> Floats:
    """Summed agreement (groups, 2 reach + 1, 2 reach + 1) of `fixed` (h, w) with `moved` (h, w) at whole shifts: row
    and column of the result, less the reach, are how many pixels down and right `moved` shows what `fixed` has.

    group (h, w): the group each pixel is of, negative for none. Pixels within the reach of the edge are of none.
    """
    parts = [np.ascontiguousarray(part) for part in (fixed.real, fixed.imag, moved.real, moved.imag)]
    total = np.zeros((groups, 2 * reach_px + 1, 2 * reach_px + 1))
    _sum_agreements(parts[0], parts[1], parts[2], parts[3], group, total)
    return total


@compiled
def _sum_agreements(
    fixed_real: Floats, fixed_imag: Floats, moved_real: Floats, moved_imag: Floats, group: Ints, total: Floats
) -> None:
    height, width = fixed_real.shape
    side = total.shape[1]
    reach = side // 2
    for row in range(reach, height - reach):
        for column in range(reach, width - reach):
            real, imag, own = fixed_real[row, column], fixed_imag[row, column], group[row, column]
            if own < 0 or (real == 0.0 and imag == 0.0):
                continue
            for down in range(side):
                for right in range(side):
                    at = (row + down - reach, column + right - reach)
                    total[own, down, right] += real * moved_real[at] + imag * moved_imag[at]

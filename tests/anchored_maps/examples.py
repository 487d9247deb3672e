"""Labels at given places."""

import numpy as np
from numpy.typing import NDArray

from trigpoint.anchoring.labels import NO_IMAGE, Labels

Floats = NDArray[np.float64]

LABEL_SIGMA_M = 0.1


def labels_at(label_m: Floats, *, image: int = NO_IMAGE) -> Labels:
    count = len(label_m)
    return Labels(
        name=tuple(f"a{row}" for row in range(count)),
        labelled_in=("" if image == NO_IMAGE else "north",) * count,
        label_m=label_m,
        sigma_m=np.full(count, LABEL_SIGMA_M),
        image=np.full(count, image, dtype=np.int64),
        kind=("pole",) * count,
        signature=("",) * count,
        images=() if image == NO_IMAGE else ("north",),
        image_sigma_m=np.zeros(0) if image == NO_IMAGE else np.array([0.35]),
    )

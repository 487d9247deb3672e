"""Landmarks as arrays: those a vehicle observes around itself, and those of the map around where it may be."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Constellation:
    """Landmarks in one frame: point_m (n, 2) in metres, covariance_m2 (n, 2, 2), kind (n,).

    Raises InputError where the shapes disagree, a number is not finite or a covariance is not positive definite.
    """

    point_m: Floats
    covariance_m2: Floats
    kind: tuple[str, ...]

    def __post_init__(self) -> None:
        count = len(self.kind)
        if self.point_m.shape != (count, 2) or self.covariance_m2.shape != (count, 2, 2):
            raise InputError(
                f"{count} landmarks: positions have shape {self.point_m.shape}, covariances {self.covariance_m2.shape}"
            )
        if not (np.isfinite(self.point_m).all() and np.isfinite(self.covariance_m2).all()):
            raise InputError("a landmark's position or covariance is not finite")
        least_m2 = np.linalg.eigvalsh(self.covariance_m2)[:, 0].min(initial=np.inf)
        if least_m2 <= 0.0:
            raise InputError(f"a landmark's covariance has an eigenvalue of {least_m2:g} m^2: it must be above 0")

    def __len__(self) -> int:
        return len(self.kind)

    def only(self, wanted: Bools) -> "Constellation":
        """The landmarks (n,) that are wanted."""
        kind = tuple(name for name, keep in zip(self.kind, wanted, strict=True) if keep)
        return replace(self, point_m=self.point_m[wanted], covariance_m2=self.covariance_m2[wanted], kind=kind)


def same_kind(one: Constellation, other: Constellation) -> Bools:
    """Which landmarks (n, m) of two constellations are of one kind."""
    return np.asarray(np.array(one.kind, dtype=str)[:, None] == np.array(other.kind, dtype=str)[None, :])

"""What a build knows beyond its events, kept beside the log so that measuring it needs no second solve.

Nothing here is truth: without it the same is solved again from the log.
"""

import zipfile
import zlib
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.events.solved import LabelReduction, SolvedMap
from trigpoint_cli.data_dir import DataDirectory
from trigpoint_optimisation.core.solve import Solution

Floats = NDArray[np.float64]

NAMES = ("landmarks", "labels", "images")  # the reduction's fields that are text
PREFIX = "reduction_"  # of the reduction's arrays in the file
WRITTEN = ("landmarks", "joint_covariance_m2", *(f"{PREFIX}{field.name}" for field in fields(LabelReduction)))


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptSolve:
    """A map version's landmarks with their joint covariance (2n, 2n) in m^2, and its reduction onto its labels."""

    landmarks: tuple[str, ...]
    joint_covariance_m2: Floats
    reduction: LabelReduction


def kept_of(solution: Solution) -> KeptSolve:
    """What is worth keeping of a solution."""
    return KeptSolve(
        landmarks=tuple(one.landmark for one in solution.map.landmarks),
        joint_covariance_m2=solution.landmark_covariance_m2,
        reduction=solution.reduction(),
    )


def keep(data: DataDirectory, map_version: int, kept: KeptSolve) -> None:
    """Kept under its map version. Raises InputError if it cannot be written."""
    path = _path(data, map_version)
    reduction = {f"{PREFIX}{field.name}": getattr(kept.reduction, field.name) for field in fields(LabelReduction)}
    arrays = {"landmarks": kept.landmarks, "joint_covariance_m2": kept.joint_covariance_m2, **reduction}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("wb") as file:
            np.savez_compressed(file, **{name: np.asarray(value) for name, value in arrays.items()})  # type: ignore[arg-type]
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error}") from error


def kept_solve(data: DataDirectory, map_version: int) -> KeptSolve | None:
    """What was kept of a map version, None where nothing (whole) was."""
    path = _path(data, map_version)
    if not path.is_file():
        return None
    try:
        with path.open("rb") as file, np.load(file) as arrays:
            found = {name: arrays[name] for name in WRITTEN}
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error):
        return None  # half written, damaged or another version's: it is solved again
    parts = {field.name: found[f"{PREFIX}{field.name}"] for field in fields(LabelReduction)}
    texts = {name: tuple(parts[name].tolist()) for name in NAMES}
    return KeptSolve(
        landmarks=tuple(found["landmarks"].tolist()),
        joint_covariance_m2=found["joint_covariance_m2"],
        reduction=LabelReduction(**(parts | texts)),
    )


def joint_covariance_m2(kept: KeptSolve | None, solved: SolvedMap) -> Floats | None:
    """All landmarks' covariance together in a map version's order, None where it was not kept for these landmarks."""
    if kept is None or kept.landmarks != tuple(one.landmark for one in solved.landmarks):
        return None
    return kept.joint_covariance_m2


def _path(data: DataDirectory, map_version: int) -> Path:
    return data.solves / f"{map_version:06d}.npz"

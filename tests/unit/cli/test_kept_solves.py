from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from evaluated_maps.examples import solved_example
from trigpoint.events.solved import LabelReduction
from trigpoint_cli.data_dir import DataDirectory
from trigpoint_cli.kept_solves import KeptSolve, joint_covariance_m2, keep, kept_solve


def kept_example() -> KeptSolve:
    example = solved_example()
    names = tuple(one.landmark for one in example.evaluated.solved.landmarks)
    return KeptSolve(landmarks=names, joint_covariance_m2=np.eye(2 * len(names)), reduction=example.reduction)


def test_what_is_kept_comes_back_equal(tmp_path: Path) -> None:
    data, kept = DataDirectory(tmp_path), kept_example()
    keep(data, 3, kept)
    found = kept_solve(data, 3)
    assert found is not None
    assert found.landmarks == kept.landmarks
    for field in fields(LabelReduction):
        np.testing.assert_array_equal(getattr(found.reduction, field.name), getattr(kept.reduction, field.name))


def test_nothing_kept_is_nothing_found(tmp_path: Path) -> None:
    assert kept_solve(DataDirectory(tmp_path), 1) is None


def kept_file(data: DataDirectory) -> Path:
    """The file of map version 1."""
    keep(data, 1, kept_example())
    (path,) = data.solves.iterdir()
    return path


@pytest.mark.parametrize("size", [0, 1000])
def test_a_file_half_written_is_as_none(size: int, tmp_path: Path) -> None:
    data = DataDirectory(tmp_path)
    path = kept_file(data)
    path.write_bytes(path.read_bytes()[:size])
    assert kept_solve(data, 1) is None


def test_a_damaged_file_is_as_none(tmp_path: Path) -> None:
    data = DataDirectory(tmp_path)
    path = kept_file(data)
    whole = path.read_bytes()
    path.write_bytes(whole[:60] + b"\xff" * 200 + whole[260:])
    assert kept_solve(data, 1) is None


def test_a_file_without_what_is_kept_today_is_as_none(tmp_path: Path) -> None:
    data = DataDirectory(tmp_path)
    with kept_file(data).open("wb") as file:
        np.savez_compressed(file, landmarks=np.array(["lm-1"]))
    assert kept_solve(data, 1) is None


def test_a_covariance_of_other_landmarks_is_not_used() -> None:
    solved = solved_example().evaluated.solved
    kept = kept_example()
    others = KeptSolve(
        landmarks=kept.landmarks[::-1], joint_covariance_m2=kept.joint_covariance_m2, reduction=kept.reduction
    )
    assert joint_covariance_m2(kept, solved) is kept.joint_covariance_m2
    assert joint_covariance_m2(others, solved) is None

"""Files replaced as a whole."""

import os
from pathlib import Path

import pytest

from trigpoint.durable_files import replace_durably, replaced_durably


@pytest.fixture
def synced(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of what was made durable, in order."""
    names: list[str] = []
    really = os.fsync

    def heard(descriptor: int) -> None:
        names.append(Path(os.readlink(f"/proc/self/fd/{descriptor}")).name)
        really(descriptor)

    monkeypatch.setattr(os, "fsync", heard)
    return names


def test_a_file_is_durable_before_it_has_its_name_and_its_name_before_that_is_said(
    tmp_path: Path, synced: list[str]
) -> None:
    replace_durably(tmp_path / "file", b"new")
    assert (tmp_path / "file").read_bytes() == b"new"
    assert synced == [f"file.{os.getpid()}.part", tmp_path.name]


def test_nobody_gets_more_rights_than_are_given(tmp_path: Path) -> None:
    (tmp_path / "key").write_bytes(b"old")
    replace_durably(tmp_path / "key", b"new", mode=0o600)
    assert (tmp_path / "key").stat().st_mode & 0o777 == 0o600


def test_what_cannot_be_written_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_bytes(b"old")
    monkeypatch.setattr(os, "fsync", _fail)
    with pytest.raises(OSError, match="no space"):
        replace_durably(tmp_path / "file", b"new")
    assert (tmp_path / "file").read_bytes() == b"old"


def test_what_is_written_apart_takes_the_file_s_place_when_it_is_durable(tmp_path: Path, synced: list[str]) -> None:
    (tmp_path / "file").write_bytes(b"old")
    with replaced_durably(tmp_path / "file") as partial:
        partial.write_bytes(b"new")
        assert (tmp_path / "file").read_bytes() == b"old"
    assert (tmp_path / "file").read_bytes() == b"new"
    assert synced == [f"file.{os.getpid()}.part", tmp_path.name]


def test_what_is_given_up_half_way_leaves_what_was_there_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"old")
    with pytest.raises(OSError, match="no space"):
        _give_up(tmp_path / "file")
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("file", b"old")]


def _give_up(path: Path) -> None:
    with replaced_durably(path) as partial:
        partial.write_bytes(b"ne")
        _fail(0)


def _fail(descriptor: int) -> None:
    raise OSError("no space")

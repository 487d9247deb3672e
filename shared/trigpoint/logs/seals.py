"""Finished log files sealed: a SHA-256 beside each, as `sha256sum --check` reads it."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from trigpoint.durable_files import replace_durably
from trigpoint.errors import LogDamaged
from trigpoint.logs.file_bytes import FileBytes
from trigpoint.logs.log_files import file_numbers, file_path
from trigpoint.logs.mcap_scan import McapScan

SUFFIX = ".sha256"  # after the file's own
SEAL_LIMIT_BYTES = 4096


def seal_path(path: Path) -> Path:
    """Where a file's seal stands."""
    return path.with_name(path.name + SUFFIX)


def is_sealed(path: Path) -> bool:
    """Whether a file has a seal; `seal_fault` says whether it holds."""
    return seal_path(path).is_file()


def seal(path: Path) -> bool:
    """Whether the file was sealed: it is finished, every checksum in it is right, and its seal is on the disk now.

    An unfinished file is left. Raises LogDamaged for one that is damaged, OSError.
    """
    scan = McapScan(path)
    for _ in scan.chunks():
        pass
    if scan.damages and not scan.torn_tail:
        raise LogDamaged(f"{scan.damages[0]}: not sealed")
    if not scan.complete or scan.damages:
        return False
    replace_durably(seal_path(path), _line(path))
    return True


@dataclass(frozen=True, slots=True, kw_only=True)
class Sealing:
    """What came of sealing: files sealed now, and what is wrong with finished files that could not be."""

    sealed: tuple[Path, ...]
    faults: tuple[str, ...]


def seal_finished(folder: Path) -> Sealing:
    """Every finished file of a stream sealed that was not and is whole. Raises OSError."""
    sealed, faults = [], []
    for path in (file_path(folder, number) for number in file_numbers(folder)):
        try:
            if not is_sealed(path) and seal(path):
                sealed.append(path)
        except LogDamaged as error:
            faults.append(str(error))
    return Sealing(sealed=tuple(sealed), faults=tuple(faults))


def seal_fault(path: Path) -> str:
    """Why a sealed file's seal does not hold, "" if it does."""
    with seal_path(path).open("rb") as file:
        said = file.read(SEAL_LIMIT_BYTES)
    held = _line(path)
    return "" if said == held else f"is not what was sealed: has {held[:64].decode()}, its seal says {said[:64]!r}"


def orphan_seals(folder: Path) -> tuple[Path, ...]:
    """Where sealed files of a stream stood that are gone."""
    seals = sorted(folder.glob(f"*{SUFFIX}"))
    stood = [path.with_name(path.name.removesuffix(SUFFIX)) for path in seals]
    return tuple(path for path in stood if not path.exists())


def _line(path: Path) -> bytes:
    return f"{_digest(path)}  {path.name}\n".encode()


def _digest(path: Path) -> str:
    digest = hashlib.sha256()
    with FileBytes(path) as content:
        for block in content.blocks():
            digest.update(block)
    return digest.hexdigest()

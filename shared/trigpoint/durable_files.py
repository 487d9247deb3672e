"""Files replaced so that a loss of power leaves the old content or the new one, never something between."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

READABLE = 0o666  # less what the process's umask takes away


def replace_durably(path: Path, content: bytes, *, mode: int = READABLE) -> None:
    """The file holds this, whole and on the disk, or what it held before; nobody ever has more rights than `mode`.

    Raises OSError.
    """
    partial = _partial(path)
    partial.unlink(missing_ok=True)
    descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(descriptor, "wb", buffering=0) as file:
        remaining = memoryview(content)
        while remaining:
            remaining = remaining[file.write(remaining) :]
        os.fsync(file.fileno())
    partial.replace(path)
    sync_folder(path.parent)


@contextmanager
def replaced_durably(path: Path) -> Iterator[Path]:
    """A path to write the new content to, which takes the file's place, whole and on the disk, when all went well.

    Where anything was raised inside, the file is as it was. Raises OSError.
    """
    partial = _partial(path)
    partial.unlink(missing_ok=True)
    try:
        yield partial
        _sync(partial, os.O_RDONLY)
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def _partial(path: Path) -> Path:
    return path.with_name(f"{path.name}.{os.getpid()}.part")  # another process may be at the same


def sync_folder(folder: Path) -> None:
    """The names in a folder durable. Raises OSError."""
    _sync(folder, os.O_RDONLY | os.O_DIRECTORY)


def _sync(path: Path, flags: int) -> None:
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)

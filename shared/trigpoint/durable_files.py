"""Files replaced so that a loss of power leaves the old content or the new one, never something between."""

import os
from pathlib import Path

READABLE = 0o666  # less what the process's umask takes away


def replace_durably(path: Path, content: bytes, *, mode: int = READABLE) -> None:
    """The file holds this, whole and on the disk, or what it held before; nobody ever has more rights than `mode`.

    Raises OSError.
    """
    partial = path.with_name(f"{path.name}.{os.getpid()}.part")  # another process may be at the same
    partial.unlink(missing_ok=True)
    descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(descriptor, "wb", buffering=0) as file:
        remaining = memoryview(content)
        while remaining:
            remaining = remaining[file.write(remaining) :]
        os.fsync(file.fileno())
    partial.replace(path)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """The names in a folder durable. Raises OSError."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)

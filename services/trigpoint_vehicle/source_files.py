"""Files of recorded data, read whole."""

from pathlib import Path

from trigpoint.errors import InputError
from trigpoint_vehicle.core.text_tables import SourceText


def read_source(folder: Path, name: str) -> SourceText:
    """A file's text. Raises InputError if it is not there or not UTF-8."""
    path = folder / name
    try:
        return SourceText(str(path), path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error

"""How far a follower of the log has come, kept in a file: lost with it is only the time to read the log again."""

import hashlib
import logging
import pickle
from pathlib import Path

from trigpoint.durable_files import replace_durably

DIGEST_BYTES = 32

logger = logging.getLogger(__name__)


def write_checkpoint(path: Path, kept: object) -> None:
    """The file replaced as a whole; a crash leaves the one before. Raises OSError."""
    body = pickle.dumps(kept)
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_durably(path, hashlib.sha256(body).digest() + body)


def read_checkpoint(path: Path) -> object | None:
    """What the file keeps; None where there is none, it is damaged, or it is of another version of the code.

    For files that a service wrote into its own data directory only.
    """
    try:
        content = path.read_bytes()
    except OSError:
        return None
    digest, body = content[:DIGEST_BYTES], content[DIGEST_BYTES:]
    if hashlib.sha256(body).digest() != digest:
        logger.warning("%s: %d bytes whose digest is another; the log is read again", path, len(content))
        return None
    try:
        kept: object = pickle.loads(body)
    except (pickle.UnpicklingError, AttributeError, ImportError, TypeError, ValueError) as error:
        logger.warning("%s: cannot be read, the log is: %s", path, error)
        return None
    return kept

"""Files of the log ended by age and sealed while a service writes it."""

import logging
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from trigpoint.errors import TrigpointError
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.seals import seal_finished

LOOK_S = 60.0  # between two looks for files that are finished, or old enough to be

logger = logging.getLogger(__name__)


@contextmanager
def sealing(log: McapLog, *, look_s: float = LOOK_S) -> Iterator[None]:
    """While it is open, the files of the streams this process writes are ended by age, and sealed once finished."""
    stop = threading.Event()
    looking = threading.Thread(target=_look_until, args=(stop, log, look_s), name="sealing", daemon=True)
    looking.start()
    try:
        yield
    finally:
        stop.set()
        looking.join()


def _look_until(stop: threading.Event, log: McapLog, look_s: float) -> None:
    while not stop.wait(look_s):
        seal_written(log, now_ns=time.time_ns())


def seal_written(log: McapLog, *, now_ns: int) -> None:
    """What is old enough ended, what is finished sealed; what cannot be is told of and looked at again later."""
    try:
        log.end_aged(now_ns)
        for stream in log.written_streams():
            for fault in seal_finished(log.directory / stream).faults:
                logger.error("a finished file is damaged: %s", fault)
    except (TrigpointError, OSError) as error:
        logger.warning("files not ended or sealed now, it is tried again: %s", error)

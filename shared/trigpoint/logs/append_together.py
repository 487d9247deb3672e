"""Appends to several streams that wait for the disk at the same time, and are entered in the catalog as one."""

import sqlite3
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future

from trigpoint.errors import TrigpointError
from trigpoint.logs.catalog import Catalog, CatalogRenewed
from trigpoint.logs.stream_writer import StreamWriter


def append_together(
    catalog: Catalog, writes: Mapping[str, Callable[[], StreamWriter]], syncing: Executor
) -> dict[str, TrigpointError]:
    """What the streams' appends failed with, of those that did. `writes` gives the rows to the operating system, one
    stream after the other; each is made durable by another thread as soon as it was written.

    All that did not fail is durable and in the catalog.
    """
    together = _Together(catalog)
    try:
        for stream, write in writes.items():
            together.write(stream, write, syncing)
        together.enter()
    except BaseException:
        together.let_go()
        raise
    return together.failures


class _Together:
    """Streams on their way through an append: those that failed are not among the writers any more."""

    def __init__(self, catalog: Catalog) -> None:
        self._catalog = catalog
        self._writers: dict[str, StreamWriter] = {}
        self._synced: dict[str, Future[None]] = {}
        self.failures: dict[str, TrigpointError] = {}

    def write(self, stream: str, write: Callable[[], StreamWriter], syncing: Executor) -> None:
        """The stream's rows written, and on their way to the disk."""
        try:
            writer = write()
        except TrigpointError as error:
            self.failures[stream] = error
        else:
            self._writers[stream] = writer
            self._synced[stream] = syncing.submit(writer.sync)

    def enter(self) -> None:
        """What was written is durable and in the catalog."""
        self._each(lambda stream, _: self._synced[stream].result())
        try:
            self._catalog.add_all([writer.growth() for writer in self._writers.values()])
        except CatalogRenewed:
            self._each(lambda _, writer: writer.enter())
        except (OSError, sqlite3.Error) as error:
            self.failures |= {stream: writer.refused(error) for stream, writer in self._writers.items()}
            self._writers.clear()
        self._each(lambda _, writer: writer.settle())

    def _each(self, step: Callable[[str, StreamWriter], None]) -> None:
        for stream, writer in list(self._writers.items()):
            try:
                step(stream, writer)
            except TrigpointError as error:
                self.failures[stream] = error
                del self._writers[stream]

    def let_go(self) -> None:
        """Nothing of what is not in the catalog is kept."""
        for stream, writer in self._writers.items():
            self._synced[stream].exception()
            writer.let_go()

"""Independent pieces of work done side by side, in threads of this process or on a cluster: Dask's one home."""

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Generic, TypeVar

from trigpoint.errors import InputError, ServiceError

if TYPE_CHECKING:
    from distributed import Client, Future

Item = TypeVar("Item")
Result = TypeVar("Result")

AHEAD = 2  # pieces handed out for each thread: one at work, one waiting beside it
REACHED_WITHIN_S = 10.0
SCHEMES = ("tcp://", "tls://")


@dataclass(frozen=True, slots=True)
class Done(Generic[Item, Result]):
    """One piece of work that ended: its result, or what it failed with."""

    item: Item
    result: Result | None
    error: Exception | None = None


class Workers:
    """Does pieces of work; made by `workers`."""

    def __init__(self, client: "Client") -> None:
        self._client = client

    @property
    def threads(self) -> int:
        """How many pieces are at work at once, as far as workers are there now; at least 1."""
        return max(1, sum(self._client.nthreads().values()))

    def each(self, work: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Done[Item, Result]]:
        """Every item worked on once, in the order they end in; items are drawn only as threads come free.

        An error ends its own piece only. A piece whose worker died is done again by another; one that ended several
        workers is given up, with distributed.KilledWorker. `work` and items must be picklable for a cluster, and work
        done twice must do no harm. Whoever leaves early leaves nothing under way.
        """
        from distributed import as_completed

        waiting = iter(items)
        under_way: dict[Future, Item] = {}
        finished = as_completed(loop=self._client.loop)
        try:
            self._hand_out(work, waiting, under_way, finished)
            for future in finished:
                item = under_way.pop(future)
                error = future.exception() if future.status == "error" else None
                yield Done(item, future.result() if error is None else None, error)
                self._hand_out(work, waiting, under_way, finished)
        finally:
            self._client.cancel(list(under_way), force=True)

    def _hand_out(
        self,
        work: Callable[[Item], Result],
        waiting: Iterator[Item],
        under_way: "dict[Future, Item]",
        finished: "as_completed",  # noqa: F821  # imported where it is used: it takes half a second
    ) -> None:
        room = AHEAD * self.threads - len(under_way)
        for item in islice(waiting, max(room, 0)):
            future = self._client.submit(work, item, pure=False)
            under_way[future] = item
            finished.add(future)


@contextmanager
def workers(cluster: str = "", *, threads: int = 0) -> Iterator[Workers]:
    """Threads of this process (0: one a core), or the workers of a Dask scheduler at an address such as
    tcp://10.0.0.1:8786.

    Raises InputError for an address or a number of threads that cannot be, ServiceError where no scheduler answers.
    """
    from distributed import Client, LocalCluster

    if threads < 0:
        raise InputError(f"threads {threads}: 0 (one a core) or more")
    if cluster and not cluster.startswith(SCHEMES):
        raise InputError(f"cluster {cluster!r}: an address of a Dask scheduler, such as tcp://10.0.0.1:8786")
    if cluster:
        with _reached(cluster) as client:
            yield Workers(client)
        return
    with (
        LocalCluster(
            n_workers=1,
            threads_per_worker=threads or os.cpu_count() or 1,
            processes=False,
            dashboard_address=None,
            memory_limit=0,
            silence_logs=False,
        ) as local,
        Client(local) as client,
    ):
        yield Workers(client)


def _reached(cluster: str) -> "Client":
    from distributed import Client

    try:
        return Client(cluster, timeout=REACHED_WITHIN_S)
    except OSError as error:
        raise ServiceError(f"no Dask scheduler at {cluster} within {REACHED_WITHIN_S:g} s: {error}") from error

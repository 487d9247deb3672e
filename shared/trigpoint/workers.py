"""Independent pieces of work done side by side, in threads of this process or by Dask workers elsewhere: Dask's one
home."""

import os
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import Any, Generic, TypeVar

from trigpoint.errors import InputError, ServiceError

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
    error: BaseException | None = None


class Tally:
    """How much of a total is done, told by several threads."""

    def __init__(self, total: int, progress: Callable[[int, int], None]) -> None:
        self._total, self._progress = total, progress
        self._done, self._lock = 0, threading.Lock()

    def more(self, count: int) -> None:
        """So much more is done; the progress is told."""
        with self._lock:
            self._done += count
            self._progress(self._done, self._total)


class Workers:
    """Does pieces of work; made by `workers`. `threads`: how many are at work at once; `are_here`: in this process."""

    def __init__(
        self, executor: Executor, threads: int, *, are_here: bool, blamed: tuple[type[Exception], ...] = ()
    ) -> None:
        """`blamed`: the errors of a piece several of whose workers died."""
        self._executor, self.threads, self.are_here, self._blamed = executor, threads, are_here, blamed

    def each(self, work: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Done[Item, Result]]:
        """Every item worked on, in the order they end in; items are drawn only as threads come free.

        An error ends its own piece only. A piece whose worker died is done again by another one. Where several of its
        workers died it may only have been beside what ended them: it is done again by itself, at the end, and given up
        if that ends workers too, with distributed.KilledWorker for error. For workers elsewhere `work`, items and
        results are pickled, and work done twice must do no harm. Who leaves early leaves nothing waiting behind.
        """
        suspects: list[Item] = []
        for done in self._ended(work, items):
            if isinstance(done.error, self._blamed):
                suspects.append(done.item)
            else:
                yield done
        for item in suspects:
            yield from self._ended(work, [item])

    def _ended(self, work: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Done[Item, Result]]:
        waiting = iter(items)
        under_way: dict[Future[Result], Item] = {}
        try:
            while self._hand_out(work, waiting, under_way):
                for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                    item, error = under_way.pop(future), future.exception()
                    yield Done(item, future.result() if error is None else None, error)
        finally:
            for future in under_way:
                future.cancel()

    def _hand_out(
        self, work: Callable[[Item], Result], waiting: Iterator[Item], under_way: dict[Future[Result], Item]
    ) -> bool:
        """Whether anything is under way."""
        for item in islice(waiting, AHEAD * self.threads - len(under_way)):
            under_way[self._executor.submit(work, item)] = item
        return bool(under_way)


class _InTurn(Executor):
    """Does what it is given at once, in the thread that gives it."""

    def submit(self, fn: Callable[..., Result], /, *args: Any, **kwargs: Any) -> Future[Result]:
        future: Future[Result] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:  # what the caller finds in the future
            future.set_exception(error)
        return future


def in_turn() -> Workers:
    """Every piece done by the caller's own thread, one after the other."""
    return Workers(_InTurn(), 1, are_here=True)


@contextmanager
def workers(cluster: str = "", *, threads: int = 0) -> Iterator[Workers]:
    """Threads of this process (0: one a core), or the workers of the Dask scheduler at an address such as
    tcp://10.0.0.1:8786, as many as there are now.

    Raises InputError for an address or a number of threads that cannot be, ServiceError where no scheduler answers or
    it has no workers.
    """
    if threads < 0:
        raise InputError(f"threads {threads}: 0 (one a core) or more")
    if cluster:
        with _elsewhere(cluster) as found:
            yield found
        return
    count = threads or os.cpu_count() or 1
    with ThreadPoolExecutor(count, thread_name_prefix="worker") as executor:
        yield Workers(executor, count, are_here=True)


@contextmanager
def _elsewhere(cluster: str) -> Iterator[Workers]:
    import distributed  # here: it takes a second, and threads do without it

    if not cluster.startswith(SCHEMES):
        raise InputError(f"cluster {cluster!r}: the address of a Dask scheduler, such as tcp://10.0.0.1:8786")
    try:
        client: Any = distributed.Client(cluster, timeout=REACHED_WITHIN_S)  # type: ignore[no-untyped-call]
    except OSError as error:
        raise ServiceError(f"no Dask scheduler answers at {cluster} within {REACHED_WITHIN_S:g} s: {error}") from error
    with client:
        threads = sum(client.nthreads().values())
        if not threads:
            raise ServiceError(f"the Dask scheduler at {cluster} has no workers")
        with client.get_executor(pure=False) as executor:
            yield Workers(executor, threads, are_here=False, blamed=(distributed.KilledWorker,))

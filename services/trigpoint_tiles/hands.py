"""Who gathers and renders: the caller's own thread, threads beside it, or workers that read the same files."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TypeVar, cast

from trigpoint.errors import InputError, ServiceError
from trigpoint.logs.ports import RecallingLog
from trigpoint.logs.readings import Progress, in_silence
from trigpoint.workers import Workers, in_turn

Item = TypeVar("Item")
Result = TypeVar("Result")
OpenLog = Callable[[], AbstractContextManager[RecallingLog]]


@dataclass(frozen=True, slots=True)
class Hands:
    """Some workers, how each of them opens the log it reads, and who is told how many sweeps are laid out and how many
    tiles are rendered, of how many."""

    some: Workers
    open_log: OpenLog
    laying_out: Progress = in_silence
    rendering: Progress = in_silence

    def each(self, what: str, work: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[tuple[Item, Result]]:
        """Every item with its result, in the order they end in.

        An item that fails costs no other. Once all others are done raises the first InputError, else ServiceError with
        how many of them are `what`, such as "pieces not gathered".
        """
        failures: list[BaseException] = []
        count = 0
        for done in self.some.each(work, items):
            count += 1
            if done.error is None:
                yield done.item, cast(Result, done.result)
            else:
                failures.append(done.error)
        if failures:
            refused = next((one for one in failures if isinstance(one, InputError)), None)
            raise refused or ServiceError(f"{len(failures)} of {count} {what}: {failures[0]}") from failures[0]

    def do(self, what: str, work: Callable[[Item], None], items: Iterable[Item]) -> None:
        """Every item done. Raises as `each` does."""
        for _ in self.each(what, work, items):
            pass


def own_hands(log: RecallingLog) -> Hands:
    """The caller's thread, with the log it has open."""
    return Hands(in_turn(), lambda: nullcontext(log))

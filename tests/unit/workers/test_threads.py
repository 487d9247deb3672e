"""Independent pieces of work in threads of this process."""

import threading
from collections.abc import Iterator

import pytest

from trigpoint.errors import InputError
from trigpoint.workers import AHEAD, workers

THREADS = 2


def squared(number: int) -> int:
    if number < 0:
        raise ValueError(f"{number} is negative")
    return number * number


def test_every_item_is_worked_on_once() -> None:
    with workers(threads=THREADS) as some:
        assert sorted((done.item, done.result) for done in some.each(squared, range(50))) == [
            (number, number * number) for number in range(50)
        ]


def test_an_error_ends_its_own_piece_only() -> None:
    with workers(threads=THREADS) as some:
        found = {done.item: (done.result, str(done.error or "")) for done in some.each(squared, [3, -1, 4])}
    assert found == {3: (9, ""), -1: (None, "-1 is negative"), 4: (16, "")}


def test_as_many_pieces_are_at_work_at_once_as_there_are_threads() -> None:
    together = threading.Barrier(THREADS, timeout=10.0)
    with workers(threads=THREADS) as some:
        errors = [done.error for done in some.each(lambda _: together.wait(), range(10 * THREADS))]
    assert errors == [None] * 10 * THREADS


def test_items_are_drawn_only_as_threads_come_free() -> None:
    drawn: list[int] = []

    def endless() -> Iterator[int]:
        while True:
            drawn.append(len(drawn))
            yield drawn[-1]

    with workers(threads=THREADS) as some:
        for ended, _ in enumerate(some.each(squared, endless()), start=1):
            assert len(drawn) <= ended + AHEAD * THREADS
            if ended == 20:
                break


def test_nothing_to_do_is_done_at_once() -> None:
    with workers() as some:
        assert list(some.each(squared, [])) == []


@pytest.mark.parametrize(
    ("cluster", "threads", "told"),
    [
        ("", -1, "threads -1: 0 .one a core. or more"),
        ("10.0.0.1:8786", 0, "cluster '10.0.0.1:8786': the address of a Dask scheduler"),
        ("http://10.0.0.1:8786", 0, "cluster 'http://10.0.0.1:8786'"),
    ],
)
def test_what_cannot_be_workers_is_refused(cluster: str, threads: int, told: str) -> None:
    with pytest.raises(InputError, match=told), workers(cluster, threads=threads):
        pass

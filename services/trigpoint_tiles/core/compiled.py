"""Functions compiled for the processor when they are first called, so that a loop over points costs what it should."""

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(kernel: Kernel) -> Kernel:
    """The kernel, compiled; what was compiled once is kept beside its source for the next process."""
    return cast(Kernel, njit(cache=True)(kernel))

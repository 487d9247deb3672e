"""Loops over points and rays, compiled when they are first called: numba's one home."""

from collections.abc import Callable
from typing import TypeVar, cast

import numba

FunctionT = TypeVar("FunctionT", bound=Callable[..., object])


def compiled(function: FunctionT) -> FunctionT:
    """The function as machine code, kept beside its source from one process to the next; threads run it side by
    side."""
    return cast(FunctionT, numba.njit(cache=True, nogil=True)(function))

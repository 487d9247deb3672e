"""Loops over rays, compiled: numba's decorator with the types of what it decorates."""

from collections.abc import Callable
from typing import TypeVar, cast

import numba

FunctionT = TypeVar("FunctionT", bound=Callable[..., object])


def compiled(function: FunctionT) -> FunctionT:
    """The function as machine code, kept beside its source for the next process; other threads run meanwhile."""
    return cast(FunctionT, numba.njit(cache=True, nogil=True)(function))

"""Loops over points and rays, compiled when they are first called: numba's one home."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic
from numpy.typing import NDArray

FunctionT = TypeVar("FunctionT", bound=Callable[..., object])

TO_WRITE, NEAREST_CACHE, DATA = 1, 3, 1  # what llvm.prefetch is told


def compiled(function: FunctionT) -> FunctionT:
    """The function as machine code, kept beside its source from one process to the next; threads run it side by
    side."""
    return cast(FunctionT, numba.njit(cache=True, nogil=True)(function))


def _fetching(typing_context: object, array: Any, index: Any) -> tuple[Any, Callable[..., Any]]:
    """Form and making of `fetch_soon` for types of numba's."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        address = builder.bitcast(builder.gep(data, [arguments[1]]), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        form = ir.FunctionType(ir.VoidType(), [address.type, number, number, number])
        prefetch = builder.module.declare_intrinsic("llvm.prefetch", [address.type], form)
        builder.call(prefetch, [address, number(TO_WRITE), number(NEAREST_CACHE), number(DATA)])
        return context.get_dummy_value()

    return types.void(array, index), generate


fetch_soon = cast(Callable[[NDArray[np.int64], int], None], intrinsic(_fetching))
"""In compiled code: a flat array's element at an index is soon written to; the processor gets it meanwhile."""

# SPDX-License-Identifier: Apache-2.0
"""One loop over threads for all kernels: Numba compiles a parallel loop once, here, not once a kernel.

Numba's ``parallel=True`` costs seconds a function: it compiles what the loop calls three times more, as part
of the loop's body, of its wrapper and of the function around it. A kernel is therefore an ordinary function
of a part and the number of parts, and its entry hands its address to the loop::

    @njit(**UNWRAPPED)
    def part_of_it(part, parts, values):
        first, past = share(part, parts, values.size)
        ...

    @njit(cache=True)
    def all_of_it(*given):
        run(task(part_of_it, given))
"""

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import get_num_threads, types
from numba.core import cgutils
from numba.core.errors import TypingError

from graycard.methods._numba import njit, prange
from graycard.methods.splat.simd._vector import _instruction

UNWRAPPED: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of functions that only kernels call: a way in for Python would cost as much as the function.

Python must not call them: there is nothing to call, and the process ends.
"""
INLINED: dict[str, Any] = {"forceinline": True, **UNWRAPPED}
"""The same, of those that become part of their callers."""

BORROWING: dict[str, Any] = {"_nrt": False}
"""Options of Numba for functions that make no array: they count no users of arrays, which their callers hold.

Else each array of a tuple that a function is given is counted, used or not: a quarter of the time of drawing
backward and of tracing. Those that return an array that they were given are for borrowing callers only.
"""
get_num_threads()
"""Starts Numba's threads. Numba does so when it compiles a parallel loop or loads one from its cache, but not
when it loads a function whose loop was loaded while it was compiled itself: a call would end the process."""

_WORD, _POINTER = ir.IntType(64), ir.IntType(8).as_pointer()
_CODE = ir.FunctionType(_WORD, [_WORD, _WORD, _POINTER])
"""Return the state of the code of a task: one if a part, of so many parts, failed on what is at an
address, else zero."""


@_instruction
def task(typing: Any, kernel: Any, given: Any) -> Any:
    """Return the addresses of code that runs a part of a kernel, and of the arguments that it reads.

    The arguments are ``given``, a tuple, after the number of the part and that of the parts. The addresses
    hold until the calling function returns, but nothing is kept alive for them. Arrays among the arguments
    must be arguments of the calling function too, which Python holds, never arrays that were made there.
    """
    if not isinstance(kernel, types.Dispatcher) or not isinstance(given, types.BaseTuple):
        raise TypingError(f"expected a kernel and a tuple of its arguments, got {kernel} and {given}")
    wanted = kernel.get_call_type(typing, (types.int64, types.int64, *cast(Any, given).types), {})
    result = types.UniTuple(types.uintp, 2)

    def code(context: Any, builder: ir.IRBuilder, _types: Any, arguments: Sequence[Any]) -> Any:
        compiled = kernel.dispatcher.get_compile_result(wanted)
        context.add_linking_libs((compiled.library,))
        place = cgutils.alloca_once_value(builder, arguments[1])
        module = builder.module
        function = ir.Function(module, _CODE, module.get_unique_name("task"))
        function.linkage = "internal"
        inner = ir.IRBuilder(function.append_basic_block())
        part, parts, data = function.args
        values = cgutils.unpack_tuple(inner, inner.load(inner.bitcast(data, place.type)))
        status, _ = context.call_internal_no_propagate(inner, compiled.fndesc, wanted, (part, parts, *values))
        inner.ret(inner.zext(status.is_error, _WORD))
        return cgutils.pack_array(builder, [builder.ptrtoint(one, _WORD) for one in (function, place)])

    return result(kernel, given), code


@_instruction
def _call(typing: Any, code: types.Type, data: types.Type, part: types.Type, parts: types.Type) -> Any:
    """Run one part of a task."""

    def call(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        function = builder.inttoptr(given[0], _CODE.as_pointer())
        return builder.call(function, [given[2], given[3], builder.inttoptr(given[1], _POINTER)])

    return types.int64(types.uintp, types.uintp, types.int64, types.int64), call


@_instruction
def _threads(typing: Any) -> Any:
    """Return how many threads work; Numba's own function of Python cannot be cached in kernels."""

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, _given: Sequence[Any]) -> Any:
        asked = ir.FunctionType(ir.IntType(32), [])
        function = cgutils.get_or_insert_function(builder.module, asked, "get_num_threads")
        return builder.sext(builder.call(function, []), _WORD)

    return types.int64(), code


@njit(parallel=True, cache=True)
def run_in(addresses: Any, parts: int) -> None:
    """Run a task in so many parts, as many at a time as there are threads.

    Raises:
        MemoryError: A part failed, most likely since it could not have memory.
    """
    failed = np.zeros(parts, np.int64)
    for part in prange(parts):
        failed[part] = _call(addresses[0], addresses[1], part, parts)
    if failed.any():
        raise MemoryError("a part of a kernel failed, most likely for want of memory. Use fewer threads")


@njit(cache=True)
def run(addresses: Any) -> None:
    """Run a task in as many parts as there are threads.

    Raises:
        MemoryError: as ``run_in``.
    """
    run_in(addresses, _threads())


@njit(**INLINED)
def share(part: int, parts: int, count: int) -> tuple[int, int]:
    """Return from where to where a part goes in a range of so many, the end excluded."""
    return part * count // parts, (part + 1) * count // parts

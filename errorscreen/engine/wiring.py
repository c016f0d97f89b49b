"""Loops over the lanes that call a model's equations, written as LLVM instructions.

As Python text the same loops take four times as long to compile: Numba works for a millisecond on each index, and a
machine with its controllers has a thousand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

_INT = ir.IntType(64)
#: an equation, rows of the buffer that it reads (of inputs: ``~index``) and writes, and index of its switch or None
Wire = tuple[Any, Sequence[int], Sequence[int], int | None]


@cache
def inlined(function: Callable[..., Any]) -> Any:
    """A function for Numba, the same for all models of a process, so that it is compiled once.

    Nothing calls it from Python or C; without wrappers it compiles faster.
    """
    return numba.njit(
        error_model="numpy", forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, _nrt=False
    )(function)


def wired(wires: Sequence[Wire], width: int) -> Any:
    """Make the function ``run(lanes, b, u, j, on)`` that Numba compiles to one loop over the lanes for each equation.

    ``b[row * width + lane]`` is the buffer, ``u[j, i]`` an input, ``on[s]`` a switch. Offsets of rows are constants,
    so that LLVM sees that no two overlap. The number of lanes is an argument, because LLVM would unroll a loop of known
    length before it makes vector instructions of it; ``lanes // width * width`` shows that no remainder is left.
    """

    @intrinsic
    def run(typingctx, lanes, b, u, j, on):
        functions = [types.Dispatcher(wire[0]) for wire in wires]
        signatures = [
            function.get_call_type(typingctx, (types.float64,) * len(wire[1]), {})
            for function, wire in zip(functions, wires, strict=True)
        ]

        def generate(context, builder, signature, arguments):
            count, buffer, inputs, step, switches = (
                argument
                if not isinstance(kind, types.Array)
                else context.make_array(kind)(context, builder, argument)
                for kind, argument in zip(signature.args, arguments, strict=True)
            )
            count = builder.mul(builder.udiv(count, _INT(width)), _INT(width))
            first = builder.mul(step, cgutils.unpack_tuple(builder, inputs.shape)[1])

            def read(row, k):
                if row < 0:
                    return builder.load(builder.gep(inputs.data, [builder.add(first, _INT(~row))]))
                return builder.load(address(row, k))

            def address(row, k):
                index = builder.add(_INT(row * width), k, flags=("nuw", "nsw"))
                return builder.gep(buffer.data, [index], inbounds=True)

            def loop(function, signature, reads, writes):
                call = context.get_function(function, signature)
                with cgutils.for_range(builder, count, intp=_INT) as lane:
                    results = call(builder, [read(row, lane.index) for row in reads])
                    kinds = signature.return_type.types
                    for i, (row, kind) in enumerate(zip(writes, kinds, strict=True)):
                        value = context.cast(builder, builder.extract_value(results, i), kind, types.float64)
                        builder.store(value, address(row, lane.index))

            for function, one, (_, reads, writes, switch) in zip(functions, signatures, wires, strict=True):
                if switch is None:
                    loop(function, one, reads, writes)
                else:
                    flag = builder.load(builder.gep(switches.data, [_INT(switch)]))
                    with builder.if_then(cgutils.is_not_null(builder, flag)):
                        loop(function, one, reads, writes)
            return context.get_dummy_value()

        return types.void(lanes, b, u, j, on), generate

    return run

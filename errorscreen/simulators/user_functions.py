"""Functions of a user's model: checked once and compiled; they run as Python where numba cannot compile them."""

from __future__ import annotations

import hashlib
import inspect
import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import is_dataclass
from functools import lru_cache, partial
from types import CodeType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.store import digest
from errorscreen.exceptions import EngineWarning, InputError, unknown_name

Function = Callable[..., Any]
_ARGUMENTS = {"rhs": "(t, x, u, p, dx)", "law": "(t, x, u, p, v)", "readout": "(t, x, u, p, y)"}

_Array = NDArray[np.float64]


def nothing(t: Any, x: Any, u: Any, p: Any, v: Any) -> None:
    """Null function of a model without this part."""


@lru_cache
def selection(rows: tuple[int, ...], n_states: int) -> Function:
    """Readout of some quantities, numbered in the order states, inputs, internal signals."""
    index = np.array(rows, dtype=np.int64)

    def readout(t: Any, x: Any, u: Any, p: Any, y: Any) -> None:
        for j in range(index.shape[0]):
            i = index[j]
            y[j] = x[i] if i < n_states else u[i - n_states]

    return readout


def identity(function: Any) -> str:
    """Fingerprint of a function: code, constants, and values of its closure and of the globals that it names."""
    return hashlib.sha256("\n".join(_parts(function)).encode()).hexdigest()[:16]


def _parts(function: Any) -> Iterator[str]:
    function = getattr(function, "py_func", function)  # of a function compiled by numba
    code = getattr(function, "__code__", None)
    if isinstance(function, partial):
        yield _described((function.args, sorted(function.keywords.items())))
        yield from _parts(function.func)
        return
    if code is None:  # a callable object: the state that a copy would have, without temporary files
        state = vars(function) if isinstance(function, type) else function.__getstate__() or {}
        yield type(function).__qualname__
        held = state if isinstance(state, dict) else {"state": state}
        yield from (f"{name} {_described(value)}" for name, value in sorted(held.items()))
        return
    yield from _parts_of_code(code)
    closure = function.__closure__ or ()
    yield from (_described(cell.cell_contents) for cell in closure if not callable(cell.cell_contents))
    known = function.__globals__
    values = ((name, known[name]) for name in code.co_names if name in known)
    yield from (
        f"{name} = {value!r}" for name, value in values if isinstance(value, int | float | str | tuple)
    )


def _described(value: Any) -> str:
    """Text that differs where values do; the repr of an array or a recording leaves numbers out."""
    whole = isinstance(value, np.ndarray) or is_dataclass(value)
    return digest(value) if whole else repr(value)


def _parts_of_code(code: CodeType) -> Iterator[str]:
    yield code.co_code.hex()
    yield repr((code.co_names, code.co_varnames))
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _parts_of_code(constant)
        else:
            yield repr(constant)


def check_outputs(outputs: Sequence[str], inside: Iterable[str], readout: bool) -> None:
    """Check the names of outputs: those of a readout must be new, others are states, inputs or signals (`inside`)."""
    known = list(inside)
    clashes = [name for name in outputs if name in known]
    if readout and clashes:
        raise InputError(
            f"the outputs {', '.join(clashes)} have the names of states, inputs or signals",
            remedy="Give the results of a readout names of their own, or leave the readout out",
        )
    for name in () if readout else outputs:
        if name not in known:
            raise unknown_name(name, known, kind="output", remedy="Outputs that are no states need a readout")


def evaluate_once(
    kind: str, function: Function, names: Sequence[str], t: float, x: _Array, u: _Array, p: _Array
) -> _Array:
    """Evaluate a function in Python, because machine code hides its mistakes: these raise `InputError`."""
    if not callable(function):
        raise InputError(
            f"{kind} is a {type(function).__name__}", allowed=f"a function {kind}{_ARGUMENTS[kind]}"
        )
    if len(inspect.signature(function).parameters) != 5:
        raise InputError(
            f"{kind} takes {len(inspect.signature(function).parameters)} arguments",
            allowed=f"{kind}{_ARGUMENTS[kind]}",
        )
    out = np.full(len(names), np.nan)
    arrays = [x.copy(), u.copy(), p.copy()]
    try:
        with np.errstate(all="ignore"):
            function(t, *arrays, out)
    except Exception as error:
        raise InputError(
            f"{kind} fails at the nominal parameters and the initial state: {type(error).__name__}: {error}",
            allowed=f"{kind}{_ARGUMENTS[kind]} with {len(x)} states, {len(u)} inputs and internal signals, {len(p)} "
            "parameters and constants",
        ) from error
    for name, before, after in zip("xup", (x, u, p), arrays, strict=True):
        if not np.array_equal(before, after, equal_nan=True):
            raise InputError(
                f"{kind} changes {name}", allowed=f"it writes {_ARGUMENTS[kind][-3:-1].strip()} only"
            )
    missing = [name for name, value in zip(names, out, strict=True) if not np.isfinite(value)]
    if missing:
        raise InputError(
            f"{kind} leaves {', '.join(missing)} unset or not finite at the nominal parameters and the initial state",
            remedy="Write every element, and check the nominal values",
        )
    return out


def parallel_map(function: Function) -> Function:
    """Function of the user for several simulations, with the signature ``ode_kernel.USER``."""

    def rows(
        t: Any, x: Any, u: Any, p: Any, out: Any, n_states: Any, first: Any, size: Any, lanes: Any
    ) -> None:
        for j in range(lanes):
            values = out[j][first : first + size]
            values[:] = np.nan  # unset values must show
            function(t, x[j][:n_states], u[j], p[j], values)

    return rows


def _is_fixed(function: Any) -> bool:
    """Whether a function refers to numbers, texts, math and numpy only, which `identity` sees."""
    code = getattr(function, "__code__", None)
    if code is None or any(isinstance(constant, CodeType) for constant in code.co_consts):
        return False
    values = [cell.cell_contents for cell in function.__closure__ or ()]
    values += [function.__globals__[name] for name in code.co_names if name in function.__globals__]
    return all(isinstance(value, int | float | str) or value is math or value is np for value in values)


@lru_cache(maxsize=64)
def _kept(function: Function, fingerprint: str) -> Any:
    return _machine_code(function)


def _machine_code(function: Function) -> Any:
    """Pointer to a compiled function."""
    from numba.core.errors import NumbaError

    try:
        return _pointer(function, counted=False)
    except NumbaError:  # a function that makes arrays of its own
        return _pointer(function, counted=True)


def _pointer(function: Function, counted: bool) -> Any:
    """Pointer to a compiled function; counting references takes nine tenths of the time of a small one."""
    import numba

    from errorscreen.simulators.ode.kernel import USER

    row = numba.types.float64[::1]
    # an index beyond an array must not reach foreign memory
    inner = numba.njit(error_model="numpy", boundscheck=True)(function)

    @numba.njit(numba.types.void(numba.types.float64, row, row, row, row), error_model="numpy", _nrt=counted)
    def guarded(t: Any, x: Any, u: Any, p: Any, out: Any) -> None:
        try:
            inner(t, x, u, p, out)
        except Exception:  # machine code cannot raise through a pointer: such a simulation becomes NaN
            for j in range(out.shape[0]):
                out[j] = np.nan

    return numba.cfunc(USER, error_model="numpy", _nrt=False)(parallel_map(guarded))


def compile_all(functions: Sequence[Function], wanted: bool = True) -> tuple[bool, list[Any]]:
    """Whether functions are compiled, and their machine code, or else `parallel_map` of each in Python."""
    compiled: list[Any] = []
    for function in functions if wanted else ():
        try:
            # others are compiled each time, because an object that they refer to may have changed
            known = function is nothing or function.__module__ == __name__ or _is_fixed(function)
            compiled.append(_kept(function, identity(function)) if known else _machine_code(function))
        except Exception as error:  # numba raises many kinds, also of its own and its compiler's
            lines = [line for line in str(error).splitlines() if line.strip()] or [type(error).__name__, ""]
            warnings.warn(
                f"{getattr(function, '__name__', 'a function')} of the model cannot be compiled and runs as Python, "
                f"some hundred times slower: {lines[0]} {lines[-1].strip()}".rstrip(),
                EngineWarning,
                stacklevel=3,
            )
            wanted = False
            break
    return wanted, compiled if wanted else [parallel_map(function) for function in functions]

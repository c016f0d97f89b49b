"""Runs a model: compiled in lanes, or in NumPy; both agree bit for bit.

32 simulations (lanes) lie side by side in memory, and the inner loop over them becomes vector instructions. Small
batches, and the rest of a large one, take 8 lanes, so that fewer are unused: a search asks for seven trial points as
often as for hundreds.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.threads import parallel_map, threads_left
from errorscreen.engine.codegen import Layout, load_module
from errorscreen.engine.stages import Model
from errorscreen.exceptions import InputError, unknown_name

#: lanes, and those of small batches
LANES, FEW_LANES = 32, 8
#: largest small batch: two blocks of 8 take less time than one of 32 that is half empty
SMALL_BATCH = 16
#: most simulations of a task: a thread that was held up leaves the rest to the others
_TASK = 64
#: relative change of a state in a step that counts as none: the rounding of an equilibrium, and little more, because a
#: latch that begins to close moves slowly
_STILL = 1e-12


class Engine:
    """Integrates a model for many parameter sets at once by the Runge-Kutta method of order four with a fixed step.

    Parameters
    ----------
    model : Model
    n_threads : int, optional
        Numba's setting where not given, which joblib limits in its worker processes. The result does not depend
        on it.

    Examples
    --------
    >>> from errorscreen.engine.stages import Call
    >>> from errorscreen.engine.examples import decay
    >>> model = Model("decay", ("u",), ("x",), ("T",), (Call(decay, ("x", "u", "T"), ("d_x",)),), ("x",))
    >>> engine = Engine(model)
    >>> y = engine.integrate(np.ones((1, 1)), np.ones((1, 1)), np.zeros((201, 1)), h=0.01)
    >>> bool(abs(y[0, 0, -1] - np.exp(-1)) < 1e-9)
    True
    """

    def __init__(self, model: Model, n_threads: int | None = None) -> None:
        self.model = model
        self.layout = Layout.of(model)
        self.n_threads = n_threads
        self._kernels: dict[int, Any] = {}
        # looked up once: a search runs many small batches of models with hundreds of quantities
        self._order = [model.states.index(name) for name in self.layout.states]
        self._switches = np.array([model.constants.index(name) for name in model.switches], dtype=np.int64)
        self._gates = np.array([model.constants.index(name) for name, _ in model.gated], dtype=np.int64)
        gated = [
            (model.states.index(s), model.constants.index(name)) for name, own in model.gated for s in own
        ]
        self._gated = np.array(gated, dtype=np.int64).reshape(-1, 2).T  # states, and the switch of each

    @property
    def threads(self) -> int:
        """Threads that share the blocks of simulations."""
        return int(self.n_threads or numba.config.NUMBA_NUM_THREADS)

    def __getstate__(self) -> dict[str, Any]:
        """Leave compiled code behind: another process finds it in the cache."""
        return {**self.__dict__, "_kernels": {}}

    def _kernel(self, lanes: int) -> Any:
        if lanes not in self._kernels:
            self._kernels[lanes] = load_module(self.model, lanes).integrate
        return self._kernels[lanes]

    def _run(self, kernel: Any, lanes: int, first: int, last: int, arguments: tuple[Any, ...]) -> None:
        """Integrate some blocks, with working memory of their own: buffer, switches, and active spans of states."""
        buffer, switches = np.zeros(self.layout.size * lanes), np.zeros(len(self._switches), bool)
        active = np.zeros(len(self.layout.spans), bool)
        kernel(np.uint64(lanes), first, last, buffer, switches, active, *arguments)

    def integrate(
        self,
        x0: NDArray[np.float64],
        constants: NDArray[np.float64],
        u: NDArray[np.float64],
        *,
        h: float,
        every: int = 1,
        tables: NDArray[np.float64] | None = None,
        segment: NDArray[np.int64] | None = None,
        record: Sequence[str] | None = None,
    ) -> NDArray[np.float64]:
        """Integrate and record the outputs.

        Parameters
        ----------
        x0 : ndarray of shape (n, n_states)
            Initial states in the order of ``model.states``.
        constants : ndarray of shape (n, n_constants)
        u : ndarray of shape (2 * n_steps + 1, n_inputs)
            Inputs at every half step.
        h : float
            Step in seconds.
        every : int
            Outputs are recorded at each `every`-th step, the first included.
        tables : ndarray of shape (n_segments, n_tables), optional
            Values of ``model.tables`` in each segment of the event.
        segment : ndarray of shape (n_steps + 1,) or (n, n_steps + 1), int, optional
            Row of `tables` that holds **throughout** each step, its end included: tables change between two steps, so
            the method keeps its order. The last entry is for the last record. The value recorded at a change is the one
            just after it. All zero where not given. With two dimensions each simulation has its own course.
        record : sequence of str, optional
            Names of the R recorded quantities; ``model.outputs`` where not given.

        Returns
        -------
        ndarray of shape (n, R, n_steps // every + 1)
            Values that are not finite where a simulation diverges.
        """
        n = len(x0)
        model, layout = self.model, self.layout
        tables, segment = _segments(model, n, len(u) // 2, tables, segment)
        record = model.outputs if record is None else record
        out = np.full((n, len(record), (len(u) // 2) // every + 1), np.nan)
        arguments = (
            np.ascontiguousarray(x0[:, self._order]),
            _plain(constants),
            _plain(u),
            tables,
            segment,
            float(h),
            int(every),
            np.array(layout.spans, dtype=np.int64).reshape(-1, 2),
            self._gates,
            self._switches,
            np.array([layout.rows[name] for name in record], dtype=np.int64),
            out,
        )
        threads = threads_left(self.threads)
        tasks = [
            partial(self._run, self._kernel(lanes), lanes, first, last, arguments)
            for lanes, first, last in _tasks(n, threads)
        ]
        parallel_map(tasks, threads)
        return out

    def acting(self, constants: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether any switch is on in each simulation (n,)."""
        return np.asarray((constants[:, self._switches] != 0).any(axis=1))

    def at_rest(
        self,
        x0: NDArray[np.float64],
        constants: NDArray[np.float64],
        *,
        h: float,
        tables: NDArray[np.float64] | None = None,
    ) -> NDArray[np.bool_]:
        """Whether a step without inputs changes no state (n,), so that none ever will; arguments as in `integrate`.

        Clocks are states: while one runs, something may still happen. States of a switch that is off do not count:
        they may move beside a simulation in which it is on, but nothing reads them.
        """
        x = self.integrate(x0, constants, np.zeros((3, 0)), h=h, tables=tables, record=self.model.states)
        still = np.abs(np.diff(x)[..., 0]) <= _STILL * np.maximum(1.0, np.abs(x0))
        states, switches = self._gated
        still[:, states] |= constants[:, switches] == 0
        return np.asarray(still.all(axis=1))


class ReferenceEngine(Engine):
    """The same model in NumPy: slow, the reference of the tests."""

    def integrate(
        self,
        x0: NDArray[np.float64],
        constants: NDArray[np.float64],
        u: NDArray[np.float64],
        *,
        h: float,
        every: int = 1,
        tables: NDArray[np.float64] | None = None,
        segment: NDArray[np.int64] | None = None,
        record: Sequence[str] | None = None,
    ) -> NDArray[np.float64]:
        """Integrate and record the outputs; see `Engine.integrate`."""
        model, n = self.model, len(x0)
        b = self._named(x0, constants)
        steps = len(u) // 2
        tables, segment = _segments(model, n, steps, tables, segment)
        record = model.outputs if record is None else record
        out = np.full((n, len(record), steps // every + 1), np.nan)
        with np.errstate(all="ignore"):  # divergence is data: it shows as values that are not finite
            for step in range(steps + 1):
                holding = tables[segment[:, step]].T
                b |= {name: np.resize(row, n) for name, row in zip(model.tables, holding, strict=True)}
                f1 = self._derivatives(b, u[2 * step])
                if step % every == 0:
                    self._evaluate(b, u[2 * step], recorded=True)
                    out[:, :, step // every] = np.array([b[name] for name in record]).T
                if step == steps:
                    break
                start = {name: b[name] for name in model.states}
                b |= {name: start[name] + 0.5 * h * f1[name] for name in start}
                f2 = self._derivatives(b, u[2 * step + 1])
                b |= {name: start[name] + 0.5 * h * f2[name] for name in start}
                f3 = self._derivatives(b, u[2 * step + 1])
                b |= {name: start[name] + h * f3[name] for name in start}
                f4 = self._derivatives(b, u[2 * step + 2])
                for name in start:
                    total = ((f1[name] + 2.0 * f2[name]) + 2.0 * f3[name]) + f4[name]
                    b[name] = start[name] + h / 6.0 * total
        return out

    def derivatives(
        self,
        x: NDArray[np.float64],
        constants: NDArray[np.float64],
        u: NDArray[np.float64],
        tables: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Derivatives of the states, shape (n, n_states), for inputs of shape (n_inputs,) and tables (n_tables,)."""
        b = self._named(x, constants)
        self._set(b, self.model.tables, np.zeros(0) if tables is None else tables)
        slopes = self._derivatives(b, u)
        return np.array([slopes[name] for name in self.model.states]).T

    def _named(
        self, x: NDArray[np.float64], constants: NDArray[np.float64]
    ) -> dict[str, NDArray[np.float64]]:
        """All given quantities by name, each of shape (n,)."""
        names = (*self.model.states, *self.model.constants)
        rows = (*x.T, *constants.T)
        return {name: np.array(row, dtype=float) for name, row in zip(names, rows, strict=True)}

    @staticmethod
    def _set(b: dict[str, NDArray[np.float64]], names: tuple[str, ...], values: NDArray[np.float64]) -> None:
        """Set quantities that all simulations share."""
        like = next(iter(b.values()))
        b |= {name: np.full_like(like, value) for name, value in zip(names, values, strict=True)}

    def _evaluate(self, b: dict[str, NDArray[np.float64]], u: NDArray[np.float64], *, recorded: bool) -> None:
        self._set(b, self.model.inputs, u)
        for call in self.model.calls:
            if call.recorded == recorded and (not call.switch or np.any(b[call.switch] != 0)):
                results = call.function(*(b[name] for name in call.reads))
                b |= dict(zip(call.writes, results, strict=True))

    def _derivatives(
        self, b: dict[str, NDArray[np.float64]], u: NDArray[np.float64]
    ) -> dict[str, NDArray[np.float64]]:
        self._evaluate(b, u, recorded=False)
        zero = np.zeros_like(next(iter(b.values())))
        return {name: np.asarray(b.get(f"d_{name}", zero)) for name in self.model.states}


def _plain(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Array of the type that the machine code is for."""
    return np.require(values, float, ["C", "W"])


def _tasks(n: int, threads: int) -> list[tuple[int, int, int]]:
    """Lanes of each task, and the first and last of its blocks of so many simulations."""
    left_over = n % LANES if n % LANES <= SMALL_BATCH else 0
    share = min(_TASK, -(-n // threads)) if threads > 1 else n
    tasks = []
    for lanes, begin, end in ((LANES, 0, n - left_over), (FEW_LANES, n - left_over, n)):
        first, most = begin // lanes, max(1, share // lanes)
        last = first - (begin - end) // lanes
        tasks += [(lanes, block, min(block + most, last)) for block in range(first, last, most)]
    return tasks


def _segments(
    model: Model, n: int, steps: int, tables: NDArray[np.float64] | None, segment: NDArray[np.int64] | None
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Tables and the row of each step (1 or n, n_steps + 1), checked: compiled code has no bounds checks."""
    tables = _plain(np.zeros((1, 0)) if tables is None else tables)
    segment = np.require(np.zeros(steps + 1) if segment is None else segment, np.int64, ["C", "W"])
    segment = np.atleast_2d(segment)
    if tables.ndim != 2 or tables.shape[1] != len(model.tables):
        raise InputError(
            f"the tables have shape {tables.shape}",
            where=f"model {model.name!r}",
            allowed=f"(number of segments, {len(model.tables)})",
        )
    fits = segment.shape[1:] == (steps + 1,) and len(segment) in (1, n)
    if not fits or not np.all((segment >= 0) & (segment < len(tables))):
        raise InputError(
            f"the segments have shape {segment.shape} or name rows that the tables do not have",
            where=f"model {model.name!r}",
            allowed=f"{steps + 1} integers from 0 to {len(tables) - 1}, for all simulations or for each of {n}",
        )
    return tables, segment


def new_engine(kind: str, model: Model, n_threads: int | None) -> Engine:
    """Engine of a kind, ``"compiled"`` or ``"numpy"``; another kind raises `InputError`."""
    engines = {"compiled": Engine, "numpy": ReferenceEngine}
    if kind not in engines:
        raise unknown_name(kind, engines, kind="engine")
    return engines[kind](model, n_threads)

"""Tables of methods: a row is a record and the addresses of kernels that work on it."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numba import typeof
from numba.core import types
from numpy.typing import NDArray

from renderer.kernels.jit import Method, Packed, compile_method, pack, record_type
from renderer.kernels.records.batch import Tile, Workspace, make_workspace

INT, FLOAT, NOTHING = types.int64, types.float32, types.none
COLUMN = types.Array(types.int32, 1, "C")  # one integer per column
ROWS = types.Array(types.float32, 2, "C")
TILE = typeof(Tile(0, 0, 1, 1, 1))

# (kernel, Numba types of its parameters after the record, type of its result)
MethodSpec = tuple[Any, tuple[Any, ...], Any]


@functools.cache
def work_types() -> Any:
    """Return the Numba types of a thread's workspace, by field name."""
    work = make_workspace(ray_capacity=16, capacity=16)
    return Workspace._make(
        record_type(part) if isinstance(part, tuple) else typeof(part) for part in work
    )


# kernel -> address by argument types. Numba's own look-up took a tenth of the time of a
# render with few pixels.
_KNOWN: WeakKeyDictionary[Any, dict[Any, int]] = WeakKeyDictionary()


def method_of(
    kernel: Any, record: Packed, arguments: tuple[Any, ...], returns: Any = NOTHING
) -> Method:
    """Return a kernel bound to a record, compiled on first use; see `compile_method`."""
    known = _KNOWN.setdefault(kernel, {})
    key = record.numba_type, arguments, returns
    if key not in known:
        known[key] = compile_method(kernel, record, *arguments, returns=returns).address
    return Method(known[key], record.address)


class MethodTables:
    """Builds tables of methods, and keeps alive what their addresses point to.

    Parameters
    ----------
    instead
        Kernel -> its replacement, with the same parameters.
    """

    def __init__(self, instead: Mapping[Any, Any] | None = None) -> None:
        self._instead = instead or {}
        self.kept: list[Packed] = []
        self.compile_seconds = 0.0  # [s] to compile the methods, or load them

    def pack(self, record: Any, source: str = "") -> Packed:
        """Pack a record whose address is passed to kernels."""
        packed = pack(record, source)
        self.kept.append(packed)
        return packed

    def prepare(self, compiles: Callable[..., None], *arguments: Any) -> None:
        """Call a function that compiles kernels for the methods, and add its time."""
        started = time.perf_counter()
        compiles(*arguments)
        self.compile_seconds += time.perf_counter() - started

    def table(
        self,
        rows: Sequence[tuple[Packed | None, Sequence[MethodSpec | None]]],
        columns: int,
    ) -> NDArray[np.int64]:
        """Compile the methods of each row; None is an unused method.

        A row without any method is all zeros.
        """
        started = time.perf_counter()
        table = np.zeros((len(rows), 1 + columns), np.int64)
        for k, (record, methods) in enumerate(rows):
            for column, spec in enumerate(methods, start=1):
                if spec is None or record is None:
                    continue
                kernel, arguments, returns = spec
                kernel = self._instead.get(kernel, kernel)
                method = method_of(kernel, record, arguments, returns)
                table[k, column], table[k, 0] = method.address, method.record
        self.compile_seconds += time.perf_counter() - started
        return table

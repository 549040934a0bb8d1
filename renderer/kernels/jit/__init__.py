"""Compiling, caching and calling kernels: how this renderer uses Numba.

`kernel` is all that is needed to write a kernel. Behind it are compiler flags
(`decorators`), the cache on disk (`cache`), linking of kernels into one another
(`linking`), records that kernels see through a pointer and tables that they gather columns
from (`records`), functions selected by the type of a record, and kernels called by address
like the methods of an object (both in `interfaces`).
"""

from renderer.kernels.jit.cache import KERNEL_CACHE, with_neighbours
from renderer.kernels.jit.decorators import (
    always_inline,
    builder_kernel,
    compiled_for,
    entry_kernel,
    kernel,
    method_kernel,
    never_inline,
)
from renderer.kernels.jit.interfaces import (
    Method,
    call,
    compile_method,
    count_of,
    interface,
)
from renderer.kernels.jit.records import (
    Packed,
    by_columns,
    column_rows,
    pack,
    record_class,
    record_type,
    table_columns,
)

__all__ = [
    "KERNEL_CACHE",
    "Method",
    "Packed",
    "always_inline",
    "builder_kernel",
    "by_columns",
    "call",
    "column_rows",
    "compile_method",
    "compiled_for",
    "count_of",
    "entry_kernel",
    "interface",
    "kernel",
    "method_kernel",
    "never_inline",
    "pack",
    "record_class",
    "record_type",
    "table_columns",
    "with_neighbours",
]

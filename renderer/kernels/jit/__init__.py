"""How kernels are compiled, kept, and called: Numba as this renderer uses it.

To write a kernel `kernel` is enough. What is behind it, a file each: the flags
(`decorators`), the cache on disk (`cache`), how kernels are linked into one another
(`linking`), records that kernels see through a pointer (`records`), tables
that they gather columns from (`columns`), kernels that are called by their address, as
methods of an object are (`methods`), and functions that are chosen by the record they
work on (`interfaces`).
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

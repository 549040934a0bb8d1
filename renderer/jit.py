"""How every kernel is compiled: one decorator, one set of flags, one cache folder.

Numba's cache looks only at the file that holds a function, so an edit in another file
that the function calls would go unnoticed (Numba manual, "Notes on Caching"). The cache
folder is therefore named by a hash of all sources of this package.
"""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path
from typing import Any

import llvmlite
import numba


def _sources_hash() -> str:
    digest = hashlib.sha256()
    package = Path(__file__).parent
    for source in sorted(package.rglob("*.py")):
        digest.update(source.relative_to(package).as_posix().encode())
        digest.update(source.read_bytes())
    digest.update(f"{numba.__version__} {llvmlite.__version__} {sys.version}".encode())
    return digest.hexdigest()[:16]


def cache_root() -> Path:
    """Folder for everything lightproof keeps between runs; `LIGHTPROOF_CACHE` moves it."""
    chosen = os.environ.get("LIGHTPROOF_CACHE")
    if chosen:
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "lightproof"


KERNEL_CACHE = cache_root() / "kernels" / _sources_hash()
numba.config.CACHE_DIR = str(KERNEL_CACHE)  # read when a kernel is created


def kernel(function: Any = None, *, inline: str = "never") -> Any:
    """Compile `function` for the inner loops.

    `nogil` lets the tile threads run side by side. `error_model="numpy"` makes a
    division plain (otherwise each is a branch and an exception path: 1.44 s against
    0.82 s on the Cornell box). No `fastmath`: the order of sums and the absence of fused
    multiply-add are part of what makes images bit-identical.
    """
    if function is None:
        return lambda f: kernel(f, inline=inline)
    return numba.njit(cache=True, nogil=True, error_model="numpy", inline=inline)(function)


def record_class(numba_type: Any) -> type | None:
    """Return the NamedTuple class behind a Numba type, None for any other type.

    Kernels that are chosen by the record they work on (`overload`) compare with this. A
    tuple of equal array types is a `NamedUniTuple`, so test the common base.
    """
    if isinstance(numba_type, numba.types.BaseNamedTuple):
        return numba_type.instance_class
    return None

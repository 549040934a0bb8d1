"""Kernels that a wheel carries, compiled for levels of x86-64 instead of one processor.

`build_wheel.py` makes them with Numba told to compile for a level by its environment. Here
nothing is told to Numba. A kernel that the user's cache lacks is looked for under the name
of the highest level that this processor has.
"""

from __future__ import annotations

import functools
import logging
from pathlib import Path

import llvmlite.binding as llvm
from numba.core import config

from renderer.kernels.jit.neighbours import PACKAGE

_V3 = (
    "+avx,+avx2,+bmi,+bmi2,+cx16,+f16c,+fma,+lzcnt,+movbe,+popcnt,+sahf,"
    "+sse3,+sse4.1,+sse4.2,+ssse3,+xsave"
)
# LLVM's name of the processor -> its features, as NUMBA_CPU_FEATURES; the highest first
LEVELS = {
    "x86-64-v4": f"{_V3},+avx512bw,+avx512cd,+avx512dq,+avx512f,+avx512vl",
    "x86-64-v3": _V3,
}
SHIPPED = PACKAGE / "kernels" / "compiled"


@functools.cache
def shipped_for_this_processor(sources: str) -> tuple[tuple[str, Path], ...]:
    """Return (level, folder of its kernels) for each level that can be run here.

    `sources` is the hash of all that kernels are made of. There is none in a checkout, nor
    where Numba was told to compile for another processor.
    """
    if config.CPU_NAME is not None or config.CPU_FEATURES is not None:
        return ()
    if SHIPPED.is_dir() and not (SHIPPED / sources).is_dir():
        logging.getLogger("renderer").warning(
            "kernels are compiled again: those in %s are for another version of Python or "
            "Numba",
            SHIPPED,
        )
    folders = ((level, SHIPPED / sources / level) for level in LEVELS)
    return tuple((level, path) for level, path in folders if path.is_dir() and runs(level))


def runs(level: str) -> bool:
    """Return whether this processor has all features of a level."""
    has = llvm.get_host_cpu_features()
    return all(has.get(name[1:], False) for name in LEVELS[level].split(","))

"""What a worker must share with whoever sends it work, so that its bits are the same."""

from __future__ import annotations

import functools
import hashlib
import sys
from pathlib import Path
from typing import NamedTuple

import llvmlite
import llvmlite.binding
import numba
import numpy as np

import renderer


class Identity(NamedTuple):
    """What runs in a process, and on which processor."""

    lightproof: str
    sources: str  # a hash of all files of the renderer
    python: str
    numba: str
    llvmlite: str
    numpy: str
    processor: str
    instructions: str  # a hash of what it can do


_WORDS = {
    "python": "Python",
    "numba": "Numba",
    "llvmlite": "llvmlite",
    "numpy": "NumPy",
    "processor": "the processor",
    "instructions": "the instruction set",
}


@functools.cache
def identity() -> Identity:
    """Return that of this process."""
    folder = Path(renderer.__file__).parent
    digest = hashlib.sha256()
    for source in sorted(folder.rglob("*.py")):
        digest.update(source.relative_to(folder).as_posix().encode())
        digest.update(source.read_bytes())
    features = llvmlite.binding.get_host_cpu_features().flatten()
    return Identity(
        renderer.__version__,
        digest.hexdigest()[:12],
        ".".join(map(str, sys.version_info[:3])),
        numba.__version__,
        llvmlite.__version__,
        np.__version__,
        llvmlite.binding.get_host_cpu_name(),
        hashlib.sha256(features.encode()).hexdigest()[:12],
    )


def why_never(ours: Identity, theirs: Identity) -> str:
    """Return why a worker is refused whatever it computes; empty if it is not."""
    if theirs.lightproof != ours.lightproof:
        return f"it has lightproof {theirs.lightproof}, and this is {ours.lightproof}"
    if theirs.sources != ours.sources:
        return (
            f"it has other sources of lightproof {ours.lightproof} ({theirs.sources}, "
            f"here {ours.sources})"
        )
    return ""


def differences(ours: Identity, theirs: Identity) -> str:
    """Return what else differs, which must be shown to change no bit; empty: nothing."""
    return ", ".join(
        f"{word} ({getattr(theirs, name)}, here {getattr(ours, name)})"
        for name, word in _WORDS.items()
        if getattr(theirs, name) != getattr(ours, name)
    )

"""The decorators and the cache: what Numba would leave to chance."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import renderer
from renderer import jit
from renderer.jit import entry_kernel, kernel


@kernel
def _doubled(x):
    return x + x


@entry_kernel
def _doubled_twice(x):
    return _doubled(_doubled(x))


def test_inner_kernel_refuses_calls_from_python() -> None:
    """Numba would jump to a null pointer once the function is compiled; we raise."""
    assert _doubled_twice(3) == 12
    with pytest.raises(TypeError, match="_doubled can be called inside kernels only"):
        _doubled(3)
    assert _doubled_twice(4) == 16


def test_kernels_divide_without_exceptions() -> None:
    """error_model numpy: 1 / 0 is infinite, as in the processor, not a Python exception."""

    @entry_kernel
    def inverse(x):
        return np.float32(1.0) / x

    assert inverse(np.float32(0.0)) == np.inf


def _hash_of(package: Path) -> str:
    """Return the name of the kernel cache that a copy of the package would use."""
    program = "import renderer.jit; print(renderer.jit.KERNEL_CACHE.name)"
    found = subprocess.run(
        [sys.executable, "-c", program],
        cwd=package.parent,
        env={"PYTHONPATH": str(package.parent), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=True,
    )
    return found.stdout.strip()


def test_cache_moves_when_a_kernel_source_changes(tmp_path: Path) -> None:
    """An edit in a file that kernels call names another folder; the reader's does not.

    Numba's own check looks at the file of the outermost function only, so without this a
    changed formula would go on being rendered from the cache.
    """
    package = tmp_path / "renderer"
    quiet = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(renderer.__file__).parent, package, ignore=quiet)
    (package / "__init__.py").write_text("")
    before = _hash_of(package)
    for left_out in ("scene_file/colors.py", "plan.py"):
        with (package / left_out).open("a") as source:
            source.write("# an edit\n")
    assert _hash_of(package) == before
    with (package / "bsdfs" / "diffuse.py").open("a") as source:
        source.write("# an edit\n")
    assert _hash_of(package) != before


def test_no_kernel_module_is_left_out_of_the_hash() -> None:
    """Whatever the hash leaves out must hold no kernel.

    The exception stands alone: its kernel calls no other file, so Numba's check suffices.
    """
    package = Path(jit.__file__).parent
    for source in package.rglob("*.py"):
        name = source.relative_to(package).as_posix()
        left_out = name.startswith(jit._WITHOUT_KERNELS)
        if left_out and name != "scene_file/png_16_bit.py":
            text = source.read_text()
            assert "@kernel" not in text and "@entry_kernel" not in text, name

"""The decorators and the cache: what Numba would leave to chance."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from compiled_kernels import ROOT
from numba.core import types
from numba.core.caching import IndexDataCacheFile
from processes import run_python

import renderer
import renderer.integrators.stages.film
from renderer.kernels.jit import (
    always_inline,
    cache,
    call,
    compile_method,
    entry_kernel,
    kernel,
    method_kernel,
    never_inline,
    pack,
    with_neighbours,
)
from renderer.kernels.jit.cache import KERNEL_FOLDERS, _Index, file_digest
from renderer.scene_file.images import png_filters


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


@kernel
def _mixed(x):
    return (x ^ (x >> 7)) * 40503 + (x << 3)


@kernel
def _mixed_eight_times(x):
    always_inline()
    return _mixed(_mixed(_mixed(_mixed(_mixed(_mixed(_mixed(_mixed(x))))))))


@kernel
def _mixed_often(x):
    """Some 320 instructions: LLVM would not put it into its callers for its size."""
    x = _mixed_eight_times(_mixed_eight_times(x))
    x = _mixed_eight_times(_mixed_eight_times(x))
    x = _mixed_eight_times(_mixed_eight_times(x))
    return _mixed_eight_times(_mixed_eight_times(x))


def test_a_kernel_of_one_caller_is_part_of_it_however_large(monkeypatch) -> None:
    """A call hands over the fields of records one by one: half of the time of some rays."""
    monkeypatch.setattr(IndexDataCacheFile, "load", lambda *_: None)  # machine code alone

    @entry_kernel
    def mixed_after_one(x):
        return _mixed_often(x + 1)

    mixed_after_one(3)
    (compiled,) = mixed_after_one.overloads.values()
    functions = compiled.library._final_module.functions
    defined = [f.name for f in functions if not f.is_declaration]
    assert any("mixed_after_one" in name for name in defined)
    assert not any("mixed_often" in name for name in defined)


class _Row(NamedTuple):
    values: Any


@method_kernel
def _add_values(row, x, out):
    never_inline()
    for k in range(out.shape[0]):
        out[k] += row.values[k] * x


@method_kernel
def _add_values_twice(row, x, out):
    _add_values(row, np.int64(1), out)
    _add_values(row, np.int64(1), out)


@entry_kernel
def _call_method(address, record, x, out):
    call(address, record, (x, out))


def test_a_method_that_others_call_keeps_its_address() -> None:
    """Its copy in their code has its name, and may be made for their arguments."""
    row = pack(_Row(np.arange(4.0)))
    arguments = (types.int64, types.Array(types.float64, 1, "C"))
    compile_method(_add_values_twice, row, *arguments)
    method = compile_method(_add_values, row, *arguments)
    out = np.zeros(4)
    _call_method(method.address, method.record, 10, out)
    np.testing.assert_array_equal(out, 10.0 * np.arange(4.0))


def test_kernels_divide_without_exceptions() -> None:
    """error_model numpy: 1 / 0 is infinite, as in the processor, not a Python exception."""

    @entry_kernel
    def inverse(x):
        return np.float32(1.0) / x

    assert inverse(np.float32(0.0)) == np.inf


SAVES_MANY = """
import sys
import numpy as np
from renderer.kernels.jit import entry_kernel

@entry_kernel
def total(tens, ones):
    return 10 * tens[0] + ones[1]

def check():
    for first in sys.argv[1].split():
        for second in sys.argv[1].split():
            arrays = np.full(3, 2, first), np.full(3, 5, second)
            assert total(*arrays) == 25, (first, second, total(*arrays))
"""


def test_processes_that_compile_at_once_do_not_mix_their_kernels(tmp_path: Path) -> None:
    """Two processes save variants of one kernel; a third must be given the right ones.

    Numba alone gives two variants one file name now and then. The kernels here differ in
    their types only, so a mix-up is a wrong number or a crash.
    """
    (tmp_path / "saves_many.py").write_text(SAVES_MANY)
    environment = os.environ | {
        "LIGHTPROOF_CACHE": str(tmp_path / "cache"),
        "PYTHONPATH": os.pathsep.join(
            [str(tmp_path), str(Path(renderer.__file__).parents[1])]
        ),
    }
    kinds = ["float32 int32", "int32 float32", "int64 int16"]
    command = [sys.executable, "-c", "import saves_many; saves_many.check()"]
    for _ in range(2):  # compile, then load what the others compiled
        running = [subprocess.Popen([*command, kind], env=environment) for kind in kinds]
        assert [process.wait() for process in running] == [0, 0, 0]


def test_two_that_save_at_once_take_turns(tmp_path: Path, monkeypatch) -> None:
    """Each waits, with its index read, for the other to come as far; only one may.

    Without turns both find the first file name free, and one kernel is lost.
    """
    together = threading.Barrier(2)
    save_index = _Index._save_index

    def wait_and_save(self, overloads):
        with contextlib.suppress(threading.BrokenBarrierError):
            together.wait(1.0)
        save_index(self, overloads)

    monkeypatch.setattr(_Index, "_save_index", wait_and_save)
    keys = [((types.int64,), "a"), ((types.float64,), "b")]
    indices = [_Index(str(tmp_path), "kernel", "stamp") for _ in keys]
    saving = [
        threading.Thread(target=index.save, args=(key, f"code of {key[1]}"))
        for index, key in zip(indices, keys, strict=True)
    ]
    for thread in saving:
        thread.start()
    for thread in saving:
        thread.join()
    found = [_Index(str(tmp_path), "kernel", "stamp").load(key) for key in keys]
    assert found == ["code of a", "code of b"]


SHARED = """
from renderer.kernels.jit import entry_kernel

@entry_kernel
def first(record):
    return record[0]
"""
OWN_CLASS = """
from typing import NamedTuple
from shared import first

class Own(NamedTuple):
    number: int

def check():
    assert first(Own(7)) == 7
    assert len(first.stats.cache_hits) == {hits}, first.stats
"""


def test_a_cache_with_another_programs_classes_is_no_obstacle(tmp_path: Path) -> None:
    """An index names the classes of arguments; a process that cannot import them compiles.

    It must not write the index over: the other program still finds its kernel. Nor does it
    import the other program's modules, with all that they do, where it could.
    """
    (tmp_path / "shared.py").write_text(SHARED)
    environment = os.environ | {
        "LIGHTPROOF_CACHE": str(tmp_path / "cache"),
        "PYTHONPATH": os.pathsep.join(
            [str(tmp_path), str(Path(renderer.__file__).parents[1])]
        ),
    }

    def run(program: str) -> int:
        return run_python("-c", program, environment=environment).returncode

    own = tmp_path / "own.py"
    own.write_text(OWN_CLASS.format(hits=0))
    assert run("import own; own.check()") == 0
    apart = "import shared, sys; shared.first((3.0,)); assert 'own' not in sys.modules"
    assert run(apart) == 0
    own.rename(tmp_path / "hidden.py")
    assert run("import shared; assert shared.first((3,)) == 3") == 0
    own.write_text(OWN_CLASS.format(hits=1))
    assert run("import own; own.check()") == 0


def test_a_cache_that_can_no_longer_be_written_is_no_obstacle(monkeypatch, caplog) -> None:
    """The disk is full: the kernel runs, is not kept, and the log says so once.

    Numba alone raises what the system said, in the middle of a picture.
    """

    def is_full(*what):
        raise OSError(errno.ENOSPC, "no space left", what[1])

    cache._warned.clear()

    @entry_kernel
    def thrice(x):
        return 3 * x

    kept = Path(thrice._cache._cache_path)
    for older in kept.glob("*thrice*"):
        older.unlink()
    with monkeypatch.context() as full:
        full.setattr(_Index, "_save_data", is_full)
        assert thrice(2.0) == thrice(np.float32(2.0)) == 6.0
    (said,) = caplog.messages
    assert said.endswith(f"compiled each time: {cache.KERNEL_CACHE}: no space left")
    assert thrice(2) == 6
    assert len(list(kept.glob("*thrice*.nbc"))) == 1


def test_a_folder_that_cannot_be_used_is_no_obstacle(monkeypatch, tmp_path, caplog) -> None:
    """Something else is in its place, or it is another user's."""
    monkeypatch.setattr(cache, "KERNEL_CACHE", tmp_path)
    cache._warned.clear()
    module = cache._ByContent(_doubled.py_func, __file__)
    Path(module.get_cache_path()).write_text("a file")

    @entry_kernel
    def fourfold(x):
        return 4 * x

    assert Path(fourfold._cache._cache_path).is_file()
    assert fourfold(2) == 8
    assert all(f"compiled each time: {tmp_path}: " in said for said in caplog.messages)
    assert 1 <= len(caplog.messages) <= 2  # on reading, and on writing


def _hash_of(package: Path) -> str:
    """Return the name of the kernel cache that a copy of the package would use."""
    program = "import renderer.kernels.jit; print(renderer.kernels.jit.KERNEL_CACHE.name)"
    found = run_python(
        "-c",
        program,
        folder=package.parent,
        environment={"PYTHONPATH": str(package.parent), "PATH": "/usr/bin:/bin"},
        check=True,
    )
    return found.stdout.strip()


def test_cache_moves_when_a_kernel_source_changes(tmp_path: Path) -> None:
    """An edit in a file that kernels call names another folder; the reader's does not.

    Numba's own check looks at the file of the outermost function only, so without this a
    changed formula would go on being rendered from the cache.
    """
    package = tmp_path / "renderer"
    half_written = shutil.ignore_patterns("*.pyc.*")  # by processes of other tests
    shutil.copytree(Path(renderer.__file__).parent, package, ignore=half_written)
    (package / "__init__.py").write_text("")
    before = _hash_of(package)
    for left_out in ("scene_file/plugins.py", "rendering/render.py"):
        with (package / left_out).open("r+") as source:
            source.seek(0, os.SEEK_END)
            source.write("# an edit\n")
    assert _hash_of(package) == before
    with (package / "plugins" / "bsdfs" / "diffuse.py").open("r+") as source:
        source.seek(0, os.SEEK_END)
        source.write("# an edit\n")
    assert _hash_of(package) != before


def test_no_kernel_module_is_left_out_of_the_hash() -> None:
    """A file outside of the folders that are hashed must hold no kernel.

    The exceptions stand alone: no other file has a part in their kernels, which are known
    by their own content.
    """
    alone = "png_filters.py", "mesh_passes.py", "obj_kernels.py"
    package = Path(renderer.__file__).parent
    for source in package.rglob("*.py"):
        name = source.relative_to(package)
        if name.parts[0] in KERNEL_FOLDERS or name.name in alone:
            continue
        text = source.read_text()
        assert not re.search(r"^ *@(\w+_)?kernel$", text, flags=re.MULTILINE), name


def test_a_kernels_neighbours_are_part_of_its_source(tmp_path: Path) -> None:
    """What it calls in files next to it is compiled into it: an edit there counts as well.

    Imports in functions and of whole folders, and of a neighbour's neighbours; a circle
    ends, and a file with a mistake is left to its importer.
    """
    texts = {
        "mine.py": "import numpy\ndef f():\n    from first.part import g",
        "first/part.py": "",
        "first/deep/part.py": "",
        "second.py": "import mine",
        "first/__init__.py": "",
        "broken.py": "def",
        "alone.py": "",
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    mine = tmp_path / "mine.py"
    names = ["first/__init__.py", "first/deep/part.py", "first/part.py", "mine.py"]
    assert sorted(with_neighbours(mine)) == [tmp_path / name for name in names]
    mine.write_text("import second, broken")
    assert {file.name for file in with_neighbours(mine)} == {
        "mine.py",
        "second.py",
        "broken.py",
    }
    part, package = tmp_path / "first" / "part.py", tmp_path / "first" / "__init__.py"
    part.write_text("from . import deep\nfrom .deep import part")
    assert set(with_neighbours(part)) == {part, package, part.parent / "deep" / "part.py"}
    part.write_text("def f():\n    from .. import second")
    package.write_text("import first.part")  # from within, by its full name
    assert {file.name for file in with_neighbours(package)} >= {"part.py", "second.py"}
    first = file_digest(str(mine))
    file_digest.cache_clear()
    (tmp_path / "second.py").write_text("import mine  # edited")
    assert file_digest(str(mine)) != first


def test_a_kernel_left_out_of_the_hash_is_known_by_its_own_file() -> None:
    """As a user's kernel is: an edit moves it to another folder, another path does not."""
    function = png_filters.undo_filters.py_func
    kept = Path(cache.KernelCache(function)._cache_path)
    assert kept.name.endswith("-" + cache.file_digest(png_filters.__file__))
    inside = Path(cache.KernelCache(_doubled.py_func)._cache_path)
    assert inside.name.endswith("-" + cache.file_digest(__file__))
    plain = Path(
        cache.KernelCache(renderer.integrators.stages.film.add_to_tile.py_func)._cache_path
    )
    assert plain.name == "renderer_integrators_stages_film"


PAIR = """
import sys
from typing import NamedTuple
import numpy as np
from numba.core import types
from renderer.kernels.jit import builder_kernel, compile_method, count_of, entry_kernel
from renderer.kernels.jit import kernel, method_kernel, pack

class Numbers(NamedTuple):
    values: np.ndarray

@kernel
def thrice(x):
    return 3 * x

@method_kernel
def total(numbers, factor):
    found = np.int64(0)
    for value in numbers.values:
        found += thrice(value) * factor
    return found

@entry_kernel
def run(address, record, factor):
    return count_of(address, record, (factor,)) + thrice(np.int64(1))

@builder_kernel
def thrice_each(numbers):
    return np.array([thrice(number) for number in numbers])

packed = pack(Numbers(np.arange(5)))
method = compile_method(total, packed, types.int64, returns=types.int64)
kernels = total, run, thrice_each
print(run(*method, 10), thrice_each(np.arange(3)).tolist())
"""


def test_kernels_work_as_compiled_and_as_loaded(tmp_path: Path) -> None:
    """Methods, entries and builders that all call one kernel, in two processes."""
    (tmp_path / "pair.py").write_text(PAIR)
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)]),
        "LIGHTPROOF_CACHE": str(tmp_path / "cache"),
    }
    program = "import pair; print([len(k.stats.cache_hits) for k in pair.kernels])"
    for hits in (0, 1):
        done = run_python("-c", program, environment=environment, check=True)
        assert done.stdout == f"303 [0, 3, 6]\n{[hits] * 3}\n"

"""Importing and using the renderer changes nothing of Numba, nor of Python's collector."""

from __future__ import annotations

import os
from pathlib import Path

from compiled_kernels import ROOT
from processes import run_python

WATCHED = """
import gc, inspect, sys, types
import numba, numba.core.codegen, numba.core.compiler

collector = gc.get_threshold(), gc.isenabled(), gc.get_freeze_count()

@numba.njit
def users_own(x):
    return x[0] + 1

users_own((1.0,))
numba.njit(lambda x, y: x @ y)

def owned():  # modules of Numba and llvmlite, and their classes
    modules = [
        (name, module)
        for name, module in sorted(sys.modules.items())
        if name.partition(".")[0] in ("numba", "llvmlite")
    ]
    found = dict(modules)
    for name, module in modules:
        for key, value in list(vars(module).items()):
            if inspect.isclass(value) and value.__module__ == name:
                found[f"{name}.{key}"] = value
    return found

def made_of(owner):  # its functions, classes, properties, ...; not its counts and caches
    kinds = (types.FunctionType, classmethod, staticmethod, property, type)
    return {k: v for k, v in vars(owner).items() if isinstance(v, kinds) or callable(v)}

before = {name: made_of(owner) for name, owner in owned().items()}
config = {k: v for k, v in vars(numba.config).items() if k.isupper()}
assert len(before) > 1000 and "finalize" in before["numba.core.codegen.CPUCodeLibrary"]

import renderer
from doubled import doubled, kernels
scene = renderer.load_dict({
    "type": "scene",
    "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}},
    "ball": {"type": "sphere"},
    "sky": {"type": "constant"},
})
assert renderer.render(scene, spp=1, integrator="depth").pixels.shape == (4, 4, 3)
assert doubled(21) == 42
libraries = {type(one.library).__module__ for k in kernels for one in k.overloads.values()}
assert libraries == {"renderer.kernels.jit.linking"}, libraries

changed = []
for name, owner in owned().items():
    for key, value in made_of(owner).items():
        old = before.get(name, {}).get(key, value)
        made_by_us = str(getattr(value, "__module__", "")).startswith("renderer")
        if old is not value or made_by_us:
            changed.append(f"{name}.{key}")
assert not changed, changed
assert {k: v for k, v in vars(numba.config).items() if k in config} == config
assert (gc.get_threshold(), gc.isenabled(), gc.get_freeze_count()) == collector

users_own((1,))
for compiled in users_own.overloads.values():
    assert type(compiled.library) is numba.core.codegen.JITCodeLibrary
    assert compiled.type_annotation is not None
assert users_own._compiler.pipeline_class is numba.core.compiler.Compiler
try:
    numba.njit(lambda x: x + "text")(1)
except numba.core.errors.TypingError as error:
    assert "candidate implementations" in str(error)
print("unchanged")
"""
DOUBLED = """
from renderer.kernels.jit import entry_kernel, kernel

@kernel
def twice(x):
    return 2 * x

@entry_kernel
def doubled(x):
    return twice(x)

kernels = twice, doubled
"""


def test_numba_stays_as_it_was(tmp_path: Path) -> None:
    """For a user's own functions: no class, function or setting of Numba is replaced.

    What a kernel compiles, a render, and an error are tried in a process of their own.
    """
    # nothing of this text is in the cache yet
    (tmp_path / "doubled.py").write_text(f"{DOUBLED}\n# {tmp_path}\n")
    paths = os.pathsep.join([str(tmp_path), str(ROOT)])
    done = run_python("-c", WATCHED, environment=os.environ | {"PYTHONPATH": paths})
    assert (done.stdout, done.stderr) == ("unchanged\n", "")

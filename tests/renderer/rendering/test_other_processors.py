"""The same tests and the same pictures where kernels are compiled for other processors.

AVX2 keeps masks in other registers than AVX-512, packs and gathers by other instructions,
and tests packets of rays by halves; what LLVM makes for SSE2 is what every other processor
gets. Each machine tests those that it is not.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.codegen import get_host_cpu_features

import renderer

TESTS = Path(__file__).parents[2]
SCENES = TESTS.parent / "scenes"
AVX2 = "+avx,+avx2,+fma,+bmi,+bmi2,+popcnt,+lzcnt,+f16c,+movbe"
PROCESSORS = {"AVX2": ("haswell", AVX2), "SSE2": ("generic", "")}


@pytest.fixture(params=PROCESSORS)
def as_on(request):
    """Return an environment in which kernels are compiled for another processor."""
    own = get_host_cpu_features().split(",")
    if "+avx2" not in own:
        pytest.skip("this processor has no AVX2")
    if request.param == "AVX2" and "+avx512f" not in own:
        pytest.skip("this processor is one: all other tests run on it")
    name, features = PROCESSORS[request.param]
    return os.environ | {
        "NUMBA_CPU_NAME": name,
        "NUMBA_CPU_FEATURES": features,
        "PYTHONPATH": os.pathsep.join(sys.path),
    }


def run_tests(environment, file, chosen):
    """Run some tests of a file in a process of its own; at least one must be there."""
    place = str(next(TESTS.rglob(file)))
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-k", chosen, place]
    run = subprocess.run(
        command, cwd=TESTS, env=environment, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert " passed" in run.stdout


def test_lanes_of_other_processors(as_on):
    """Masks, gathers and packing are other instructions there: the same tests must pass."""
    chosen = "under or masks or minimum or comparisons or joined or reductions"
    run_tests(as_on, "test_lanes.py", chosen)
    run_tests(as_on, "test_lanes_fused.py", "test")


@pytest.mark.slow
def test_streams_of_other_processors(as_on):
    """With AVX2 alone rays go one by one in leaves, elsewhere 16 go together."""
    run_tests(as_on, "test_streams.py", "test")


DRAW = """
import hashlib, sys, numpy, renderer
scene = renderer.load_file(sys.argv[1], width="24", height="24")
pixels = numpy.asarray(renderer.render(scene, 3, threads=1, accel=sys.argv[2]))
print(hashlib.sha256(pixels.tobytes()).hexdigest())
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "accel"),
    [("cornell-box", "auto"), ("textured-room", "wide"), ("instances", "auto")],
)
def test_pictures_of_other_processors(as_on, name, accel):
    """Bit for bit: boxes and packets, streams and textures."""
    path = SCENES / name / "scene.xml"
    scene = renderer.load_file(path, width="24", height="24")
    pixels = np.asarray(renderer.render(scene, 3, threads=1, accel=accel))
    command = [sys.executable, "-c", DRAW, str(path), accel]
    run = subprocess.run(command, env=as_on, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert run.stdout.split() == [hashlib.sha256(pixels.tobytes()).hexdigest()]

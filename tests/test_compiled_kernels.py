"""What a new process compiles where others have compiled before, kernel by kernel."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from compiled_kernels import ROOT, Compiled, compiled_by
from small_scenes import box, diffuse, glass, mirror, rectangle, scene, sensor, sphere

import renderer
import renderer.stages.scatter  # fills the set of methods, also where this file runs alone
from renderer.kernels.jit.linking import SEPARATE

BSDFS: dict[str, dict[str, Any]] = {
    "diffuse": diffuse(0.2),
    "conductor": mirror(),
    "dielectric": glass(),
}


def render_box_with(kind: str, root: str) -> None:
    """Render a box with a lamp and, in it, a ball of a kind of BSDF: a few pixels.

    With the sources in the folder `root`.
    """
    assert Path(renderer.__file__).parents[1] == Path(root)
    lamp = rectangle((0, 0, 1), (0.3, 0, 0), (0, -0.3, 0), diffuse(0.0), shine=5.0)
    view = sensor((0.1, -0.9, 0.2), (0, 0.5, -0.2), fov=80, size=(4, 4))
    ball = sphere(BSDFS[kind], radius=0.1)
    content = scene(view, "path", *box(0.7), lamp, ball, max_depth=5)
    renderer.render(renderer.load_dict(content), accel="brute", threads=1)


def rendered(kind: str, cache: Path, root: Path = ROOT) -> list[Compiled]:
    statement = f'test_compiled_kernels.render_box_with("{kind}", "{root}")'
    return compiled_by(statement, cache, root)


class Around(NamedTuple):
    """A cache in which a box has been rendered, and what that compiled."""

    cache: Path
    kernels: list[Compiled]


@pytest.fixture(scope="module")
def around(tmp_path_factory: pytest.TempPathFactory) -> Around:
    cache = tmp_path_factory.mktemp("cache")
    return Around(cache, rendered("diffuse", cache))


def test_one_more_kind_of_bsdf_compiles_its_own_kernels_only(around: Around) -> None:
    """Where the box has been rendered before; each time by a new process.

    What is compiled belongs to the folder of BSDFs, or is made for the record of the kind:
    no stage, light, shape or accelerator. The path tracer around it is found in the cache.
    Functions without a module are the loaders of parameters, written by a program.
    """
    names = {kernel.name for kernel in around.kernels}
    assert {"trace_paths", "reflect_light", "scatter_kind"} <= names
    for name in ("conductor", "dielectric"):
        added = rendered(name, around.cache)
        assert f"renderer.kinds.bsdfs.{name}" in {kernel.module for kernel in added}
        record = name.capitalize()
        own = (f"Record.{record}.", f"{record}(", "Record.BsdfMethods.")
        others = [
            kernel
            for kernel in added
            if kernel.module is not None
            and not kernel.module.startswith("renderer.kinds.bsdfs.")
            and not kernel.arguments[0].startswith(own)
        ]
        assert others == []
        # the only one that becomes machine code
        methods = [kernel.name for kernel in added if kernel.name in SEPARATE]
        assert methods == ["scatter_kind"]
        assert len(added) <= 20


def test_a_second_copy_of_the_sources_compiles_nothing(
    around: Around, tmp_path: Path
) -> None:
    """Kernels are known by what they are made of, not by where that lies."""
    assert "trace_paths" in {kernel.name for kernel in around.kernels}
    half_written = shutil.ignore_patterns("*.pyc.*")  # by processes of other tests
    package = Path(renderer.__file__).parent
    shutil.copytree(package, tmp_path / "renderer", ignore=half_written)
    assert rendered("diffuse", around.cache, tmp_path) == []

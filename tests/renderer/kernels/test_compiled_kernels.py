"""What a new process compiles where others have compiled before, kernel by kernel."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest
from compiled_kernels import ROOT, Needed, needed_by
from small_scenes import box, diffuse, glass, mirror, rectangle, scene, sensor, sphere

import renderer

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


def box_with(kind: str, root: Path = ROOT, anew: str = "") -> list[Needed]:
    """Return the kernels that `render_box_with` needs in a new process."""
    statement = f'test_compiled_kernels.render_box_with("{kind}", "{root}")'
    return needed_by(statement, root, anew)


@pytest.fixture(scope="module")
def of_a_diffuse_ball() -> list[Needed]:
    return box_with("diffuse", anew="scatter_kind")


def of_their_own(kernels: list[Needed]) -> list[Needed]:
    """Return the kernels that are machine code of their own."""
    return [kernel for kernel in kernels if kernel.caller == ""]


def test_one_more_kind_of_bsdf_compiles_its_own_kernels_only(
    of_a_diffuse_ball: list[Needed],
) -> None:
    """Where the box has been rendered before; each time by a new process.

    What is added belongs to the folder of BSDFs or to the lanes that formulas are written
    in, or is made for the record of the kind: no stage, light, shape or accelerator. The
    path tracer around it is found in the cache.
    """
    before = {kernel[:3] for kernel in of_a_diffuse_ball}
    names = {kernel.name for kernel in of_their_own(of_a_diffuse_ball)}
    assert {"trace_paths", "reflect_light", "scatter_kind"} <= names
    for kind in ("conductor", "dielectric"):
        kernels = box_with(kind, anew="scatter_kind")
        added = [kernel for kernel in kernels if kernel[:3] not in before]
        assert f"renderer.plugins.bsdfs.{kind}" in {kernel.module for kernel in added}
        record = kind.capitalize()
        folders = ("renderer.plugins.bsdfs.", "renderer.kernels.lanes.")
        own = (f"Record.{record}.", f"{record}(", "Record.BsdfMethods.")
        others = [
            kernel
            for kernel in added
            if not kernel.module.startswith(folders)
            and not kernel.arguments[0].startswith(own)
        ]
        assert others == []
        # the only one that becomes machine code, and all else is found
        assert [kernel.name for kernel in of_their_own(added)] == ["scatter_kind"]
        assert len(added) <= 20
        compiled = [kernel for kernel in of_their_own(kernels) if not kernel.found]
        assert {kernel.name for kernel in compiled} == {"scatter_kind"}


def test_a_second_copy_of_the_sources_compiles_nothing(
    of_a_diffuse_ball: list[Needed], tmp_path: Path
) -> None:
    """Kernels are known by what they are made of, not by where that lies."""
    needed = {kernel[:3] for kernel in of_their_own(of_a_diffuse_ball)}
    assert "trace_paths" in {name for _, name, _ in needed}
    half_written = shutil.ignore_patterns("*.pyc.*")  # by processes of other tests
    package = Path(renderer.__file__).parent
    shutil.copytree(package, tmp_path / "renderer", ignore=half_written)
    copy = box_with("diffuse", tmp_path)
    assert {kernel[:3] for kernel in copy} == needed
    assert [kernel for kernel in copy if not kernel.found] == []

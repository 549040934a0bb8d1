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


def box_with(kind: str, root: Path = ROOT) -> list[Needed]:
    """Return the kernels that `render_box_with` needs in a new process."""
    return needed_by(f'test_compiled_kernels.render_box_with("{kind}", "{root}")', root)


@pytest.fixture(scope="module")
def of_a_diffuse_ball() -> list[Needed]:
    return box_with("diffuse")


def test_one_more_kind_of_bsdf_needs_one_kernel_of_its_own(
    of_a_diffuse_ball: list[Needed],
) -> None:
    """All else is what the box needs with a diffuse ball, for the same types of arguments.

    That has been rendered before, so it is found; a new kind compiles its own
    `scatter_kind` with what this calls, and no kernel of another stage, of a light, a shape
    or an accelerator.
    """
    before = {kernel[:3] for kernel in of_a_diffuse_ball}
    assert {"trace_paths", "reflect_light", "scatter_kind"} <= {
        name for _, name, _ in before
    }
    for kind in ("conductor", "dielectric"):
        kernels = box_with(kind)
        added = [kernel for kernel in kernels if kernel[:3] not in before]
        assert [kernel.name for kernel in added] == ["scatter_kind"]
        assert all(kernel.found for kernel in kernels if kernel[:3] in before)
        assert added[0].arguments[0].startswith("Record.BsdfMethods.")


def test_a_second_copy_of_the_sources_compiles_nothing(
    of_a_diffuse_ball: list[Needed], tmp_path: Path
) -> None:
    """Kernels are known by what they are made of, not by where that lies."""
    assert "trace_paths" in {kernel.name for kernel in of_a_diffuse_ball}
    half_written = shutil.ignore_patterns("*.pyc.*")  # by processes of other tests
    package = Path(renderer.__file__).parent
    shutil.copytree(package, tmp_path / "renderer", ignore=half_written)
    copy = box_with("diffuse", tmp_path)
    assert {kernel[:3] for kernel in copy} == {kernel[:3] for kernel in of_a_diffuse_ball}
    assert [kernel for kernel in copy if not kernel.found] == []

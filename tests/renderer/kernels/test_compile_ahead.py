"""`lightproof --compile`: small scenes that need every kernel; later none is compiled."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from compiled_kernels import ROOT, needed_by

import renderer
from renderer.command import cli, compile_ahead
from renderer.command.every_kernel import small_scenes, without_replay, write_files
from renderer.errors import SceneError
from renderer.integrators.registry import IN_FILES, INTEGRATORS
from renderer.kernels.jit import Method
from renderer.plugins.bsdfs.registry import BSDFS, WRAPPERS
from renderer.plugins.lights.registry import LIGHTS
from renderer.plugins.sensors.registry import SENSORS
from renderer.plugins.shapes.registry import SHAPES
from renderer.plugins.textures.registry import TEXTURES
from renderer.process.names import ACCELERATORS, REPLAY, SAMPLERS
from renderer.rendering import job
from renderer.rendering.tables import methods


def plugins_in(part: Any) -> set[str]:
    if not isinstance(part, dict):
        return set()
    inside = set().union(*map(plugins_in, part.values()))
    return inside | ({part["type"]} if "type" in part else set())


def test_every_plugin_is_in_a_small_scene(tmp_path: Path) -> None:
    """A new one that needs a property fails to load, and belongs in `_REQUIRED`."""
    write_files(tmp_path)
    scenes = list(small_scenes())
    for small in scenes:
        renderer.load_dict(small.scene, base_dir=tmp_path)
    plugins = set().union(*(plugins_in(small.scene) for small in scenes))
    for registry in (BSDFS, WRAPPERS, LIGHTS, SENSORS, TEXTURES, IN_FILES):
        assert set(registry) <= plugins
    assert all(plugins & set(kind.plugins) for kind in SHAPES.values())
    renders = [options for small in scenes for options in small.renders]
    for option, names in {
        "integrator": set(INTEGRATORS),
        "accel": set(ACCELERATORS),
        "sampler": {*SAMPLERS, REPLAY},
    }.items():
        assert names <= {options.get(option) for options in renders}
    left = {o.get("sampler") for one in map(without_replay, scenes) for o in one.renders}
    assert REPLAY not in left and "sobol" in left


class _AllKnown(Exception):
    """Raised when all methods of a render are known."""


def requested_methods(monkeypatch: pytest.MonkeyPatch) -> set[tuple[str, ...]]:
    """Return the set in which methods are noted from now on, instead of compiled."""
    requested: set[tuple[str, ...]] = set()

    def note(kernel: Any, record: Any, arguments: Any, returns: Any = None) -> Method:
        name = f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}"
        requested.add((name, str(record.numba_type), str(arguments)))
        return Method(1, record.address)

    def stop(self: job.RenderJob) -> float:
        work = job.pack(self.make_workspace(self.shape.channels))
        types = methods.TILE, methods.INT, work.numba_type
        note(self._trace, self._packed_scene, types)
        raise _AllKnown

    monkeypatch.setattr(methods, "method_of", note)
    monkeypatch.setattr(job.RenderJob, "compile", stop)
    monkeypatch.setattr(job, "compile_builders", lambda *_: 0.0)
    return requested


def request_methods(scene: renderer.Scene, **options: Any) -> None:
    with pytest.raises(_AllKnown):
        renderer.render(scene, **{"spp": 4, "threads": 1} | options)


SCENES = (
    "analytic-shapes",
    "caustic",
    "cornell-box",
    "emitters",
    "evening-sky",
    "measured-ball",
    "metals",
    "principled-gallery",
    "rough-materials",
    "smooth-mesh",
    "textured-room",
    "whitted-spheres",
)


@pytest.mark.slow
def test_scenes_need_no_other_methods(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    """Of those without BSDFs that are nested in each other in their own way."""
    write_files(tmp_path)
    requested = requested_methods(monkeypatch)
    for small in map(without_replay, small_scenes()):
        scene = renderer.load_dict(small.scene, base_dir=tmp_path)
        for options in small.renders:
            request_methods(scene, **options)
    ahead = requested.copy()
    assert len(ahead) > 300
    for name in SCENES:
        scene = renderer.load_file(ROOT / "scenes" / name / "scene.xml")
        requested.clear()
        request_methods(scene)
        request_methods(scene, sampler="stratified")
        assert requested <= ahead, name


# ------------------------------------------------------------------------- on the disk

COMPILE = """
import sys
from renderer.command import compile_ahead
steps = []
if __name__ == "__main__":
    anew = compile_ahead.compile_all(lambda *now: steps.append(now), names=sys.argv[1:])
    total = len(steps) - 1
    assert anew and steps == [(k, total) for k in range(total + 1)], steps
"""


def render_unlike_scenes() -> None:
    """Render what the small scenes below have, in other sizes and numbers."""
    sky = {"type": "constant"}
    view = {"type": "perspective", "film": {"type": "hdrfilm", "width": 9, "height": 7}}
    glass = {"type": "sphere", "radius": 0.7, "bsdf": {"type": "dielectric"}}
    scenes = [
        {"type": "scene", "sensor": view, "sky": sky, "a": {"type": "sphere"}},
        {"type": "scene", "sensor": view, "sky": sky, "a": glass},
        {"type": "scene", "sensor": view, "sky": sky, "a": glass, "b": {"type": "sphere"}},
    ]
    for scene in scenes:
        for name in ("path", "depth"):
            renderer.render(
                renderer.load_dict(scene), spp=2, integrator=name, accel="brute"
            )


@pytest.mark.slow
def test_later_renders_compile_nothing(tmp_path: Path, monkeypatch) -> None:
    """Of the part that is compiled here: all of it takes minutes."""
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    (tmp_path / "compile.py").write_text(COMPILE)
    names = ("integrators", "independent", "constant", "dielectric", "brute")
    subprocess.run([sys.executable, tmp_path / "compile.py", *names], check=True)
    kernels = needed_by("test_compile_ahead.render_unlike_scenes()")
    assert {"trace_paths", "scatter_kind", "closest_hit"} <= {
        kernel.name for kernel in kernels
    }
    assert [kernel for kernel in kernels if not kernel.found] == []


def test_what_is_there_is_not_compiled_again(monkeypatch, tmp_path) -> None:
    """A file says that all kernels are there, for the processor that they are for."""
    monkeypatch.setattr(compile_ahead, "KERNEL_CACHE", tmp_path)
    compile_ahead._marker().touch()
    assert compile_ahead.compile_all(pytest.fail) is False


def test_a_cache_that_cannot_be_written_is_refused(monkeypatch, tmp_path) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(compile_ahead, "KERNEL_CACHE", tmp_path / "file" / "kernels")
    with pytest.raises(SceneError, match="kernels cannot be kept there"):
        compile_ahead.compile_all(pytest.fail)


def test_the_command_shows_how_far_it_is(monkeypatch, capfd) -> None:
    def compile_all(show: Any) -> bool:
        show(0, 2)
        show(2, 2)
        return True

    monkeypatch.setattr(compile_ahead, "compile_all", compile_all)
    assert cli.main(["--compile"]) == 0
    found = capfd.readouterr()
    assert found.err == "compiling kernels: 0 of 2 scenes\n"
    assert found.out.startswith("all kernels are compiled, in 0 s")
    assert cli.main(["--compile", "--quiet"]) == 0
    assert capfd.readouterr() == ("", "")
    monkeypatch.setattr(compile_ahead, "compile_all", lambda show: False)
    assert cli.main(["--compile"]) == 0
    assert capfd.readouterr() == ("all kernels are compiled\n", "")
    assert cli.main(["--compile", "scene.xml"]) == 2
    assert "--compile takes no scene" in capfd.readouterr().err

"""A wheel with kernels: nothing is compiled where it is installed; bits are the same."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from importlib.metadata import distribution
from pathlib import Path

import pytest
from compiled_kernels import ROOT

from build_wheel import build_wheel
from renderer.kernels.jit.cache import runs

LEVEL = "x86-64-v3"
# Scenes of `every_kernel`: all methods, a BSDF, a lens, lamps that are meshes, instances.
NAMES = ("integrators", "dielectric", "thinlens", "area triangles", "instances of spheres")
# What `pip install lightproof` brings, with what that needs.
PACKAGES = ["numpy", "numba", "llvmlite", "OpenEXR", "pillow", "rich"]
PACKAGES += ["markdown-it-py", "mdurl", "pygments"]
PROGRAM = """
import hashlib, json, logging, sys, tempfile
from pathlib import Path
from numba.core import event
import renderer
from renderer.command.every_kernel import small_scenes, without_replay, write_files

compiled, said, pictures = [], [], {}

class Listener(event.Listener):
    def on_start(self, started):
        compiled.append(started.data["dispatcher"].py_func.__qualname__)
    def on_end(self, ended):
        pass

class Handler(logging.Handler):
    def emit(self, record):
        said.append(record.getMessage())

logging.getLogger("renderer").addHandler(Handler())
folder = Path(tempfile.mkdtemp())
write_files(folder)
with event.install_listener("numba:compile", Listener()):
    for small in map(without_replay, small_scenes()):
        if small.name in sys.argv[1:]:
            small.scene["sensor"]["film"] |= {"width": 17, "height": 11}
            scene = renderer.load_dict(small.scene, base_dir=folder)
            for options in small.renders:
                picture = renderer.render(scene, spp=4, seed=3, **options).pixels
                digest = hashlib.sha256(picture.tobytes()).hexdigest()
                pictures[f"{small.name} {options}"] = digest
print(json.dumps([renderer.__file__, compiled, said, pictures]))
"""


def rendered(python: Path | str, folder: Path, **environment: str):
    done = subprocess.run(
        [python, "-c", PROGRAM, *NAMES],
        cwd=folder,
        env={"PATH": os.environ["PATH"], "HOME": str(folder)} | environment,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


def fresh_environment(folder: Path, wheel: Path) -> Path:
    """Return the Python of a new environment with a wheel and its default dependencies."""
    venv.create(folder)
    places = {"base": str(folder), "platbase": str(folder)}
    site = Path(sysconfig.get_path("platlib", "venv", places))
    for name in PACKAGES:  # linked, so that no index is queried
        packaged = distribution(name)
        for top in {file.parts[0] for file in packaged.files or ()} - {"..", "__pycache__"}:
            link = site / top
            if not link.exists():
                link.symlink_to(Path(packaged.locate_file(top)).resolve())
    python = folder / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", python, "install"]
    elsewhere = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    command = [*pip, "--quiet", "--no-index", "--no-deps", wheel]
    subprocess.run(command, env=elsewhere, check=True)
    return python


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.skipif(not runs(LEVEL), reason=f"this processor is no {LEVEL}")
def test_an_installed_wheel_compiles_nothing(tmp_path: Path) -> None:
    """Its kernels are of a part of all plugins: all of them take minutes."""
    wheel = build_wheel(tmp_path / "dist", [LEVEL], NAMES)
    tag = f"cp{sys.version_info[0]}{sys.version_info[1]}"
    assert wheel.name.endswith(f"-{tag}-{tag}-linux_x86_64.whl")
    with zipfile.ZipFile(wheel) as archive:
        assert archive.testzip() is None
        (about,) = (n for n in archive.namelist() if n.endswith(".dist-info/WHEEL"))
        assert "Root-Is-Purelib: false" in archive.read(about).decode()
    python = fresh_environment(tmp_path / "fresh", wheel)
    file, compiled, said, pictures = rendered(python, tmp_path)
    assert Path(file).is_relative_to(tmp_path / "fresh")
    assert (compiled, said) == ([], [])
    assert list((tmp_path / ".cache").rglob("*.nb?")) == []
    own = {"PYTHONPATH": str(ROOT), "LIGHTPROOF_CACHE": str(tmp_path / "own")}
    file, compiled, _, of_checkout = rendered(sys.executable, tmp_path, **own)
    assert Path(file).is_relative_to(ROOT) and "trace_paths" in compiled
    assert len(pictures) > 10 and pictures == of_checkout

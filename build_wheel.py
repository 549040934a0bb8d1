"""Build a wheel with compiled kernels: `make wheel`, or `python build_wheel.py dist`.

The kernels are compiled in processes of their own, which Numba's environment tells to
compile for a level of x86-64; they run there too, so that a level is left out that this
processor lacks. They fit one version of Python, and the versions of Numba and llvmlite that
are installed here; with others a user's machine compiles its own.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Collection
from pathlib import Path
from tempfile import TemporaryDirectory

from renderer.kernels.jit.cache import LEVELS, runs

ROOT = Path(__file__).parent
_COMPILE = """
import sys
from renderer.command.compile_ahead import compile_all
compile_all(
    lambda done, total: print(f"\\r{done} of {total}", end="", flush=True),
    replay=False,
    names=sys.argv[1:],
)
print()
"""


def build_wheel(
    output: Path, levels: Collection[str] = tuple(LEVELS), names: Collection[str] = ()
) -> Path:
    """Return the wheel that was written to the folder `output`.

    Parameters
    ----------
    output
        Made if it is missing.
    levels
        Of `cache.LEVELS`.
    names
        Of the scenes of `every_kernel` whose kernels are carried; empty: all.
    """
    output.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as made:
        pure = _pure_wheel(Path(made))
        site = Path(made) / "site"
        with zipfile.ZipFile(pure) as archive:
            archive.extractall(site)
        for level in levels:
            if runs(level):
                _say(f"compiling kernels for {level}")
                _add_kernels(site, level, Path(made) / level, names)
            else:
                _say(f"no kernels for {level}, which this processor cannot run")
        return _packed(site, pure.name, output)


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def _pure_wheel(folder: Path) -> Path:
    source = folder / "source"  # setuptools leaves folders in the one that it works in
    ignored = shutil.ignore_patterns("__pycache__", "out", "build", "*.egg-info", ".*")
    source.mkdir()
    for name in ("renderer", "mitsuba_ref", "reports"):
        shutil.copytree(ROOT / name, source / name, ignore=ignored)
    for name in ("pyproject.toml", "lightproof.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps"]
    subprocess.run([*pip, "--wheel-dir", folder, source], check=True)
    (wheel,) = folder.glob("*.whl")
    return wheel


def _add_kernels(site: Path, level: str, cache: Path, names: Collection[str]) -> None:
    told = {"NUMBA_CPU_NAME": level, "NUMBA_CPU_FEATURES": LEVELS[level]}
    found = {"PYTHONPATH": str(site), "LIGHTPROOF_CACHE": str(cache)}
    environment = os.environ | told | found
    command = [sys.executable, "-c", _COMPILE, *names]
    subprocess.run(command, cwd=site, env=environment, check=True)
    (kernels,) = (cache / "kernels").glob("[0-9a-f]" * 16)
    target = site / "renderer" / "kernels" / "compiled" / kernels.name / level
    ignored = shutil.ignore_patterns("*.lock", "*.json", "all-*")
    shutil.copytree(kernels, target, ignore=ignored)


def _packed(site: Path, pure_name: str, output: Path) -> Path:
    """Write a wheel of a folder's content, with the tag of this Python and platform."""
    tag = sys.implementation.cache_tag.replace("cpython-", "cp")
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    tag = f"{tag}-{tag}-{platform}"
    wheel = output / pure_name.replace("py3-none-any", tag)
    (about,) = site.glob("*.dist-info")
    text = (about / "WHEEL").read_text()
    text = text.replace("py3-none-any", tag).replace("Purelib: true", "Purelib: false")
    (about / "WHEEL").write_text(text)
    record = about / "RECORD"
    record.unlink()
    files = sorted(
        path
        for path in site.rglob("*")
        if path.is_file() and path.parent.name != "__pycache__"
    )
    lines = []
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in files:
            name, content = path.relative_to(site).as_posix(), path.read_bytes()
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest())
            lines.append(f"{name},sha256={digest.rstrip(b'=').decode()},{len(content)}\n")
            archive.writestr(name, content)
        name = record.relative_to(site).as_posix()
        archive.writestr(name, "".join([*lines, f"{name},,\n"]))
    return wheel


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path, help="a folder")
    written = build_wheel(parser.parse_args().output)
    _say(f"{written}: {written.stat().st_size / 1e6:.1f} MB")

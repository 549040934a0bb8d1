"""How long the whole program takes to start: a process from nothing to a picture."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from reports.errors import ReportError

TIME_LIMIT = 300.0  # [s]


def start_command(scene: str, parameters: Mapping[str, str], output: str) -> list[str]:
    """Return the arguments after `python` for one sample per pixel of `scene`."""
    arguments = ["-m", "renderer", scene, "--spp", "1", "-o", output]
    for name, value in parameters.items():
        arguments += ["-D", f"{name}={value}"]
    return arguments


def warm_starts(scene: Path, parameters: Mapping[str, str], repeats: int) -> list[float]:
    """Return the seconds of whole processes that find every kernel in the cache."""
    cache = dict(os.environ)
    _start(scene, parameters, cache)  # fills the cache; not counted
    return [_start(scene, parameters, cache) for _ in range(repeats)]


def cold_starts(scene: Path, parameters: Mapping[str, str], repeats: int) -> list[float]:
    """Return the seconds of whole processes that have to compile every kernel."""
    seconds = []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as empty:
            cache = {**os.environ, "LIGHTPROOF_CACHE": empty}
            seconds.append(_start(scene, parameters, cache))
    return seconds


def _start(
    scene: Path, parameters: Mapping[str, str], environment: Mapping[str, str]
) -> float:
    root = str(Path(__file__).resolve().parents[2])
    paths: Sequence[str] = [root, *filter(None, [environment.get("PYTHONPATH")])]
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "start.npy"
        command = [sys.executable, *start_command(str(scene), parameters, str(output))]
        begin = time.perf_counter()
        try:
            run = subprocess.run(
                command,
                env={**environment, "PYTHONPATH": os.pathsep.join(paths)},
                capture_output=True,
                text=True,
                timeout=TIME_LIMIT,
            )
        except subprocess.TimeoutExpired:
            raise ReportError(
                f"python -m renderer: no picture within {TIME_LIMIT:g} s"
            ) from None
        seconds = time.perf_counter() - begin
        if run.returncode != 0 or not output.is_file():
            words = run.stderr.strip().splitlines() or ["no message"]
            raise ReportError(f"python -m renderer: status {run.returncode}: {words[-1]}")
    return seconds

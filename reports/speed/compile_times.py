"""How long kernels take to compile: the first pictures of nine scenes in one process.

Processor seconds, of all threads, from an empty cache on. What one scene compiled the next
ones find, so the sum is what counts, and each number depends on the scenes before it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from mitsuba_ref.records import machine
from reports.errors import ReportError
from reports.records.circumstances import Circumstances
from reports.records.json_file import read_json

SCHEMA = 1
FORMER = {
    "cornell-box": 13.7,
    "colour-bleeding": 10.9,
    "caustic": 8.8,
    "metals": 28.3,
    "smooth-mesh": 7.0,
    "textured-room": 10.0,
    "analytic-shapes": 8.9,
    "instances": 20.8,
    "emitters": 10.6,
}
"""Scenes in their order, and what each took in an earlier version, 119 s in all [s]."""

SIZE = 16  # pixels a side
ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class SceneTime:
    """One scene's first picture."""

    scene: str
    seconds: float  # of the processor
    former: float | None = None


@dataclass(frozen=True, kw_only=True)
class CompileTimes(Circumstances):
    """A whole compile_times.json."""

    scenes: tuple[SceneTime, ...]

    @property
    def seconds(self) -> float:
        """All scenes together."""
        return sum(one.seconds for one in self.scenes)

    @property
    def former(self) -> float:
        """The same in the older version."""
        return sum(one.former or 0.0 for one in self.scenes)


def read_compile_times(path: Path) -> CompileTimes:
    """Read and check compile_times.json; raise ReportError for what is wrong."""
    return read_json(path, CompileTimes, SCHEMA)


def measure_compile_times(
    command: str,
    progress: Callable[[str], None],
    scenes: Sequence[str] = tuple(FORMER),
) -> CompileTimes:
    """Render each scene once, all in one process that finds no compiled kernel.

    Parameters
    ----------
    command
        That repeats the measurement.
    progress
        Told what is being done.
    scenes
        Names of folders in scenes/.

    Raises
    ------
    ReportError
        If the process ends before its last picture.
    """
    times: list[SceneTime] = []
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    with tempfile.TemporaryDirectory() as empty, tempfile.TemporaryFile("w+") as errors:
        place = {"LIGHTPROOF_CACHE": empty, "PYTHONPATH": os.pathsep.join(paths)}
        progress(f"compiling from an empty cache: {scenes[0]}, 1 of {len(scenes)}")
        with subprocess.Popen(
            [sys.executable, "-m", "reports.speed.compile_times", *scenes],
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            env={**os.environ, **place},
        ) as process:
            try:
                for line in process.stdout or ():
                    found = json.loads(line)
                    name = found["scene"]
                    times.append(SceneTime(name, found["seconds"], FORMER.get(name)))
                    following = scenes[len(times) : len(times) + 1]
                    for scene in following:
                        progress(f"compiling: {scene}, {len(times) + 1} of {len(scenes)}")
            finally:
                if len(times) < len(scenes):
                    process.kill()
        if len(times) < len(scenes):
            errors.seek(0)
            words = errors.read().strip().splitlines() or ["no message"]
            raise ReportError(f"{scenes[len(times)]}: no picture: {words[-1]}")
    return CompileTimes(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        command=command,
        commit=machine.current_commit(),
        machine=machine.describe_machine(),
        versions=machine.installed_versions(),
        scenes=tuple(times),
    )


def main(scenes: Sequence[str]) -> None:
    """Render each scene once; write a line of JSON with its processor seconds."""
    import renderer  # imports compile nothing, and are not counted

    size = {"width": str(SIZE), "height": str(SIZE), "spp": "1"}
    for name in scenes:
        begin = time.process_time()
        scene = renderer.load_file(ROOT / "scenes" / name / "scene.xml", **size)
        renderer.render(scene, spp=1, threads=1)
        seconds = time.process_time() - begin
        sys.stdout.write(json.dumps({"scene": name, "seconds": seconds}) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])

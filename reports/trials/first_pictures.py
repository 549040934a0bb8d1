"""What precedes a picture: processes that start, and kernels that compile.

`python -m reports.trials.first_pictures SCENE...` is one of these processes: it renders
each scene once and writes a line of JSON with its processor seconds.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SIZE = 16  # pixels a side
TIME_LIMIT = 300.0  # [s]


def start_seconds(
    scene: Path, parameters: Mapping[str, str], cache: Path | None = None
) -> float:
    """Return the seconds of `python -m renderer` from nothing to a picture.

    Parameters
    ----------
    scene, parameters
        Rendered at 1 sample per pixel.
    cache
        Folder of compiled kernels; None: the one of this process.

    Raises
    ------
    ValueError
        If there is no picture, or not within `TIME_LIMIT`.
    """
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "start.npy"
        words = ["-m", "renderer", str(scene), "--spp", "1", "-o", str(output)]
        words += [f"-D{name}={value}" for name, value in parameters.items()]
        begin = time.perf_counter()
        try:
            run = subprocess.run(
                [sys.executable, *words],
                env=_environment(cache),
                capture_output=True,
                text=True,
                timeout=TIME_LIMIT,
            )
        except subprocess.TimeoutExpired:
            limit = f"no picture within {TIME_LIMIT:g} s"
            raise ValueError(f"python -m renderer: {limit}") from None
        seconds = time.perf_counter() - begin
        if run.returncode != 0 or not output.is_file():
            last = _last_line(run.stderr)
            raise ValueError(f"python -m renderer: status {run.returncode}: {last}")
    return seconds


def compile_seconds(
    scenes: Sequence[str], show: Callable[[str], None]
) -> Iterator[tuple[str, float]]:
    """Render each scene once in one process whose cache is empty at first.

    Parameters
    ----------
    scenes
        Names of folders in scenes/.
    show
        Called with what is being compiled.

    Yields
    ------
    scene, seconds
        Processor time of all threads.

    Raises
    ------
    ValueError
        If the process ends before its last picture.
    """
    words = ["-m", "reports.trials.first_pictures", *scenes]
    with (
        tempfile.TemporaryDirectory() as empty,
        tempfile.TemporaryFile("w+") as errors,
        subprocess.Popen(
            [sys.executable, *words],
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            env=_environment(Path(empty)),
        ) as process,
    ):
        try:
            for number, scene in enumerate(scenes, 1):
                show(f"compiling: {scene}, {number} of {len(scenes)}")
                line = process.stdout.readline() if process.stdout else ""
                if not line:
                    process.wait()
                    errors.seek(0)
                    raise ValueError(f"{scene}: no picture: {_last_line(errors.read())}")
                yield scene, float(json.loads(line)["seconds"])
        finally:
            process.kill()


def _environment(cache: Path | None) -> dict[str, str]:
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    own = {} if cache is None else {"LIGHTPROOF_CACHE": str(cache)}
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths), **own}


def _last_line(text: str) -> str:
    return (text.strip().splitlines() or ["no message"])[-1]


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

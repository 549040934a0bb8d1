"""Mitsuba for a stopwatch: a loaded, warm scene in a process of its own, any variant.

A benchmark lets renderers take turns, so Mitsuba stays alive between its turns. It lives
in another process because its variants exclude one another in one, and because
`llvm_ad_rgb` ends the process where it finds an LLVM that it cannot use.
"""

from __future__ import annotations

import json
import os
import re
import select
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from mitsuba_ref.errors import MitsubaError
from mitsuba_ref.variant import MIN_THREADS

TIME_LIMIT = 600.0
"""Seconds for one answer, the start of Mitsuba included."""

LLVM_FOLDERS = (
    "/usr/lib/*-linux-gnu",
    "/usr/lib/llvm-*/lib",
    "/usr/lib64",
    "/usr/lib",
    "/usr/local/lib",
    "/opt/homebrew/opt/llvm*/lib",
    "/usr/local/opt/llvm*/lib",
)
# Mitsuba 3.9.1 aborts on 15 ("Cannot select: fminimum") and is known to work on 19.
LLVM_MAJORS = range(16, 20)


@dataclass(frozen=True)
class TimedRender:
    """One render: seconds from the call until the array is in memory, and its mean."""

    seconds: float
    mean: tuple[float, float, float]  # linear sRGB, over all pixels


class TimedMitsuba:
    """A scene file in one Mitsuba variant, loaded and ready; a context manager.

    Parameters
    ----------
    variant
        `scalar_rgb`, `llvm_ad_rgb`, ...
    path
        Mitsuba 3 XML, rendered as it is.
    parameters
        Values for the file's `$name`.
    threads
        Worker threads, at least 2.

    Raises
    ------
    MitsubaError
        Why this variant cannot render the scene here.
    """

    def __init__(
        self, variant: str, path: Path, parameters: Mapping[str, str], threads: int
    ) -> None:
        if threads < MIN_THREADS:
            raise MitsubaError(
                f"Mitsuba needs {MIN_THREADS} threads or more, not {threads}"
            )
        self.variant = variant
        environment = _environment(variant)
        self._errors = tempfile.TemporaryFile()
        job = {
            "variant": variant,
            "path": str(path),
            "parameters": {name: str(value) for name, value in parameters.items()},
            "threads": threads,
        }
        self._process = subprocess.Popen(
            [sys.executable, "-m", "mitsuba_ref.timing", json.dumps(job)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env=environment,
        )
        try:
            self._answer()  # loaded
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        """Return itself, loaded."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the process."""
        self.close()

    def render(self, seed: int, spp: int) -> TimedRender:
        """Render once.

        Raises
        ------
        MitsubaError
            When Mitsuba refuses, ends, or is silent for `TIME_LIMIT` seconds.
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(
                json.dumps({"seed": seed, "spp": spp}).encode() + b"\n"
            )
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # the answer, or its absence, says why
        answer = self._answer()
        red, green, blue = answer["mean"]
        return TimedRender(float(answer["seconds"]), (red, green, blue))

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout, self._errors):
            if stream is not None:
                # A request that a dead process has not read is still in the buffer.
                with suppress(BrokenPipeError):
                    stream.close()

    def _answer(self) -> dict[str, Any]:
        stream = self._process.stdout
        assert stream is not None
        if not select.select([stream], [], [], TIME_LIMIT)[0]:
            raise MitsubaError(f"{self.variant}: no answer within {TIME_LIMIT:g} s")
        line = stream.readline()
        if not line:
            status = self._process.wait()
            raise MitsubaError(f"{self.variant}: {self._last_words(status)}")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise MitsubaError(f"{self.variant}: {answer['error']}")
        return answer

    def _last_words(self, status: int) -> str:
        self._errors.seek(0)
        words = self._errors.read().decode(errors="replace").splitlines()
        said = [line.strip() for line in words if line.strip()] or ["no message"]
        # LLVM names the cause first and then prints what it was compiling.
        cause = next((line for line in said if "error" in line.lower()), said[-1])
        return f"the process ended with status {status}: {cause[:200]}"


def find_llvm(folders: Sequence[str] = LLVM_FOLDERS) -> Path | None:
    """Return the newest LLVM library that Mitsuba can use, or None.

    Parameters
    ----------
    folders
        Absolute glob patterns of folders.
    """
    found: dict[int, Path] = {}
    for folder in folders:
        for library in sorted(Path("/").glob(folder.lstrip("/") + "/libLLVM*")):
            name = re.fullmatch(
                r"libLLVM(?:-(\d+)\.(?:so|dylib)|\.so\.(\d+)(?:\.\d+)*)", library.name
            )
            if name:
                found.setdefault(int(name[1] or name[2]), library)
    usable = [major for major in found if major in LLVM_MAJORS]
    return found[max(usable)] if usable else None


def _environment(variant: str) -> dict[str, str]:
    root = str(Path(__file__).parent.parent)
    paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    if variant.startswith("llvm") and "DRJIT_LIBLLVM_PATH" not in environment:
        library = find_llvm()
        if library is None:
            majors = f"{LLVM_MAJORS[0]} to {LLVM_MAJORS[-1]}"
            raise MitsubaError(f"{variant}: no libLLVM {majors} in the usual folders")
        environment["DRJIT_LIBLLVM_PATH"] = str(library)
    return environment


def serve(job: dict[str, Any]) -> None:
    """Load the scene, say so, then answer one render for each line of standard input."""
    # Mitsuba prints too: keep the real output for answers, send the rest to stderr.
    output = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def say(answer: dict[str, Any]) -> None:
        output.write(json.dumps(answer) + "\n")
        output.flush()

    try:
        import drjit
        import mitsuba

        mitsuba.set_variant(job["variant"])
        mitsuba.set_log_level(mitsuba.LogLevel.Error)
        drjit.set_thread_count(job["threads"])
        scene = mitsuba.load_file(job["path"], **job["parameters"])
        say({"loaded": True})
        for line in sys.stdin:
            wanted = json.loads(line)
            start = time.perf_counter()
            # A JIT variant only notes the work until somebody asks for the numbers.
            image = np.array(mitsuba.render(scene, spp=wanted["spp"], seed=wanted["seed"]))
            seconds = time.perf_counter() - start
            mean = image[..., :3].mean(axis=(0, 1), dtype=np.float64)
            say({"seconds": seconds, "mean": [float(value) for value in mean]})
    except Exception as error:
        say({"error": " ".join(str(error).split())[:500] or type(error).__name__})


if __name__ == "__main__":
    serve(json.loads(sys.argv[1]))

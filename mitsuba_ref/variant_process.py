"""A Mitsuba variant in a process of its own: a JSON line asks, a JSON line answers.

A measurement lets renderers take turns, so Mitsuba stays alive between its turns. It lives
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
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from mitsuba_ref.errors import MitsubaError

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


Answerer = Callable[[dict[str, Any]], dict[str, Any]]


class VariantProcess:
    """Runs `python -m MODULE` for one variant; a context manager.

    Parameters
    ----------
    module
        Calls `answer_requests` when it is run.
    variant
        `scalar_rgb`, `llvm_ad_rgb`, ...
    job
        What the module is given at its start, beside the variant's name.

    Raises
    ------
    MitsubaError
        Why this variant cannot work here.
    """

    def __init__(self, module: str, variant: str, job: Mapping[str, Any]) -> None:
        self.variant = variant
        environment = _environment(variant)
        self._errors = tempfile.TemporaryFile()
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, json.dumps({"variant": variant, **job})],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env=environment,
        )
        try:
            self.loaded = self._answer()
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

    def ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Return the answer to one request.

        Raises
        ------
        MitsubaError
            When Mitsuba refuses, ends, or is silent for `TIME_LIMIT` seconds.
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # the answer, or its absence, says why
        return self._answer()

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


def answer_requests(
    start: Callable[[dict[str, Any]], tuple[dict[str, Any], Answerer]],
) -> None:
    """Load by `start` what the command line says, then answer each line of standard input.

    Parameters
    ----------
    start
        Gets the job; returns the first answer, and what answers each request.
    """
    # Mitsuba prints too: keep the real output for answers, send the rest to stderr.
    output = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def say(answer: dict[str, Any]) -> None:
        output.write(json.dumps(answer) + "\n")
        output.flush()

    try:
        loaded, answer = start(json.loads(sys.argv[1]))
        say(loaded)
        for line in sys.stdin:
            say(answer(json.loads(line)))
    except Exception as error:
        say({"error": " ".join(str(error).split())[:500] or type(error).__name__})

"""A renderer in a separate process: each request is a JSON line, each answer too.

Mitsuba can hang (EXR files with too few threads) or end its process (an LLVM that it cannot
use), and so can a mutant of our renderer. The harness must survive both. Both ends of the
pipe are here, so that each kind of failure is a class of `errors`.
"""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from mitsuba_ref.missing_packages import failed_package
from mitsuba_ref.reference.errors import (
    MitsubaCrashed,
    MitsubaError,
    MitsubaRefused,
    MitsubaTimeout,
)
from renderer.errors import PluginError

LONGEST_MESSAGE = 1000  # characters; Mitsuba may list every property of a scene

Answerer = Callable[[dict[str, Any]], dict[str, Any]]


class JsonProcess:
    """Runs `python -m MODULE`; a context manager.

    Parameters
    ----------
    module
        Calls `answer_requests` when it is run.
    job
        What the module is given at its start.
    name
        How messages call it.
    time_limit
        Seconds for one answer; for the first one, the start of Mitsuba is included.
    environment
        Variables to set in addition to those of this process.
    folder
        Where it runs; None: here.
    refusals
        Exceptions of the process, by name, that are raised here as what they are.
    python
        The interpreter; another one may have packages that this one lacks.

    Raises
    ------
    MitsubaError
        Why it cannot work here.
    ImportError
        If a package of the harness cannot be imported there.
    """

    def __init__(
        self,
        module: str,
        job: Mapping[str, Any],
        *,
        name: str,
        time_limit: float,
        environment: Mapping[str, str] | None = None,
        folder: Path | None = None,
        refusals: Mapping[str, type[Exception]] | None = None,
        python: str = sys.executable,
    ) -> None:
        self.name = name
        # a user's plugin file is imported there too, and has its own error messages
        self.refusals: dict[str, type[Exception]] = {PluginError.__name__: PluginError}
        self.refusals |= refusals or {}
        self.time_limit = time_limit
        root = str(Path(__file__).parents[2])
        paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
        self._errors = tempfile.TemporaryFile()
        self._words_before = 0  # where the error output of this request begins
        self._process = subprocess.Popen(
            [python, "-m", module, json.dumps(dict(job))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            cwd=folder,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths), **(environment or {})},
            # Ctrl-C is for the harness, which then ends this process.
            start_new_session=True,
        )
        try:
            self.loaded = self._answer()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        """Return itself, loaded."""
        return self

    def __exit__(self, *error: object) -> None:
        """End the process."""
        self.close()

    def ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Return the answer to one request.

        Raises
        ------
        MitsubaRefused, MitsubaCrashed, MitsubaTimeout
            When Mitsuba refuses, ends, or is silent for `time_limit` seconds; after the
            last two the process is of no more use.
        MitsubaError
            When our own code in the process failed.
        PluginError
            When a user's file of plugins did.
        """
        assert self._process.stdin is not None
        self._words_before = self._errors.seek(0, os.SEEK_END)
        # A dead process does not read; its answer, or the absence of one, says why.
        with suppress(BrokenPipeError):
            self._process.stdin.write(json.dumps(dict(request)).encode() + b"\n")
            self._process.stdin.flush()
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
        line = self._line()
        if not line:
            raise MitsubaCrashed(f"{self.name}: {self._last_words()}")
        try:
            answer: dict[str, Any] = json.loads(line)
            error = answer.get("error")
        except (ValueError, AttributeError):
            raise MitsubaError(f"{self.name}: {line[:80]!r} is no answer") from None
        if error is None:
            return answer
        kind, refused = answer.get("kind", ""), bool(answer.get("refused"))
        for base in answer.get("bases", ()):
            if base in self.refusals:
                raise self.refusals[base](error)
        if lacks := answer.get("lacks"):
            raise ImportError(error, name=lacks)
        what = f"{kind}: {error}" if kind and not (refused and error) else error
        raise (MitsubaRefused if refused else MitsubaError)(f"{self.name}: {what}")

    def _line(self) -> bytes:
        """Return one whole line, or nothing if the process has closed its output.

        Read in pieces: a process may also hang in the middle of a line.
        """
        stream = self._process.stdout
        assert stream is not None
        end, line = time.monotonic() + self.time_limit, b""
        while not line.endswith(b"\n"):
            left = max(0.0, end - time.monotonic())
            if not select.select([stream], [], [], left)[0]:
                raise MitsubaTimeout(
                    f"{self.name}: no answer within {self.time_limit:g} s; it was ended"
                )
            piece = os.read(stream.fileno(), 1 << 16)
            if not piece:
                return b""
            line += piece
        return line

    def _last_words(self) -> str:
        try:
            status = self._process.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            return "the process closed its output and gave no answer"
        self._errors.seek(self._words_before)
        words = self._errors.read().decode(errors="replace").splitlines()
        said = [line.strip() for line in words if line.strip()] or ["no message"]
        # LLVM names the cause first and then prints what it was compiling.
        cause = next((line for line in said if "error" in line.lower()), said[-1])
        return f"the process ended with status {status}: {cause[:200]}{_signal(status)}"


def _signal(status: int) -> str:
    """Return the name of the signal that ended a process, if one did."""
    with suppress(ValueError):
        if status < 0:
            return f" ({signal.Signals(-status).name})"
    return ""


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
    except Exception as error:
        say(_failure(error))
        return
    say(loaded)
    for line in sys.stdin:
        try:
            found = answer(json.loads(line))
        except Exception as error:  # the next request may be a sound one
            found = _failure(error)
        say(found)


def _failure(error: Exception) -> dict[str, Any]:
    """Return the answer that stands for an exception.

    Mitsuba's refusals are RuntimeErrors (measured on 19 broken scenes), and MemoryError is
    its way to say that a picture is too large; anything else is a mistake of ours.
    """
    return {
        "error": " ".join(str(error).split())[:LONGEST_MESSAGE],
        "kind": type(error).__name__,
        "bases": [base.__name__ for base in type(error).__mro__],
        "refused": isinstance(error, (RuntimeError, MemoryError)),
        "lacks": failed_package(error),
    }

"""Mitsuba in a process of its own, with a time limit.

Mitsuba can hang (EXR files with too few threads) and can end the process (a bad LLVM);
neither may take the harness along. The worker answers JSON lines; on silence it is
killed, and the next request starts another.
"""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from mitsuba_ref.cache import write_entry
from mitsuba_ref.errors import MitsubaError
from mitsuba_ref.reference import render_reference
from mitsuba_ref.request import RenderRequest

TIME_LIMIT = 900.0
"""Seconds for one picture, the import of Mitsuba included."""


class MitsubaWorker:
    """Starts the process at the first request and ends it with the `with` block."""

    def __init__(self, time_limit: float = TIME_LIMIT) -> None:
        self.time_limit = time_limit
        self._process: subprocess.Popen[str] | None = None
        self._answers: queue.Queue[str] = queue.Queue()

    def __enter__(self) -> Self:
        """Return the worker itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the process."""
        self.stop()

    def render(self, request: RenderRequest, path: Path) -> None:
        """Render `request` and write the cache entry `path`.

        Raises
        ------
        MitsubaError
            When Mitsuba refuses the scene, dies, or is silent for `time_limit` seconds.
        """
        process = self._process or self._start()
        assert process.stdin is not None
        try:
            process.stdin.write(json.dumps([asdict(request), str(path)]) + "\n")
            process.stdin.flush()
            answer = self._answers.get(timeout=self.time_limit)
        except queue.Empty:
            self.stop()
            raise MitsubaError(
                f"Mitsuba did not answer within {self.time_limit:g} s and was ended"
            ) from None
        except BrokenPipeError:
            answer = ""
        except BaseException:
            self.stop()  # Ctrl-C: an answer that comes later must not meet a later request
            raise
        if not answer:
            status = process.wait()
            self.stop()
            raise MitsubaError(f"Mitsuba's process ended with status {status}")
        error = json.loads(answer)["error"]
        if error:
            raise MitsubaError(error)

    def stop(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                # A request that a dead process has not read is still in the buffer.
                with suppress(BrokenPipeError):
                    stream.close()

    def _start(self) -> subprocess.Popen[str]:
        root = str(Path(__file__).parent.parent)
        paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
        process = subprocess.Popen(
            [sys.executable, "-m", "mitsuba_ref.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            # Ctrl-C is for the harness, which then ends the worker.
            start_new_session=True,
        )
        answers: queue.Queue[str] = queue.Queue()
        self._process, self._answers = process, answers
        assert process.stdout is not None
        threading.Thread(
            target=_pass_on, args=(process.stdout, answers), daemon=True
        ).start()
        return process


def _pass_on(stream: IO[str], answers: queue.Queue[str]) -> None:
    """Put each line into `answers`, then an empty one when the process has ended."""
    try:
        for line in stream:
            answers.put(line)
    except ValueError:
        pass  # closed by `stop`
    answers.put("")


def serve() -> None:
    """Answer requests from standard input until it closes."""
    # Mitsuba prints too: keep the real output for answers, send the rest to stderr.
    output = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    for line in sys.stdin:
        fields, path = json.loads(line)
        error = None
        try:
            write_entry(render_reference(RenderRequest(**fields)), Path(path))
        except (MitsubaError, OSError, ValueError) as problem:
            error = " ".join(str(problem).split())
        output.write(json.dumps({"error": error}) + "\n")
        output.flush()


if __name__ == "__main__":
    serve()

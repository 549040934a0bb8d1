"""What a long command is doing: a spinner on a terminal, plain lines anywhere else."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

LINE_EVERY = 2.0  # [s]; a stage that begins sooner after a line is not written
SAID_AGAIN = 8.0  # [s] without a line; then the stage is written again
LOOK_EVERY = 1.0  # [s]

Show = Callable[[str], None]


class StageLines:
    """Writes a line for a stage that begins, and again while it lasts.

    Parameters
    ----------
    stream
        Where to; standard error, mostly.
    clock
        Seconds from any moment on.
    """

    def __init__(self, stream: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        self._stream = stream
        self._clock = clock
        self._start = clock()
        self._written = -LINE_EVERY  # seconds after the start
        self._stage = ""
        self._lock = threading.Lock()

    def __call__(self, stage: str) -> None:
        """Take note of a stage that begins."""
        with self._lock:
            self._stage = stage
            self._write_after(LINE_EVERY)

    def remind(self) -> None:
        """Write the stage again if nothing was written for long."""
        with self._lock:
            if self._stage:
                self._write_after(SAID_AGAIN)

    def _write_after(self, silence: float) -> None:
        now = self._clock() - self._start
        if now - self._written >= silence:
            self._written = now
            self._stream.write(f"[{now:5.0f} s] {self._stage}\n")
            self._stream.flush()


@contextmanager
def shown_stages(
    stream: TextIO | None = None, look_every: float = LOOK_EVERY
) -> Iterator[Show]:
    """Show the stages that the block reports, until it ends.

    Parameters
    ----------
    stream
        None: standard error.
    look_every
        Seconds between two checks whether a line is due.
    """
    stream = sys.stderr if stream is None else stream
    if stream.isatty() and os.environ.get("TERM") != "dumb":
        # here, because rich takes 0.1 s that a pipe need not wait for
        from rich.console import Console

        with Console(file=stream).status("") as status:
            yield status.update
        return
    lines, over = StageLines(stream), threading.Event()

    def watch() -> None:
        while not over.wait(look_every):
            lines.remind()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield lines
    finally:
        over.set()
        watcher.join()

"""What a terminal shows while a render runs: a bar with the time left, or plain lines."""

from __future__ import annotations

import os
from types import TracebackType
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

    from renderer.rendering.sitting import Progress

BAR_AFTER = 0.3  # [s]; a render that is over by then needs no bar
BAR_EVERY = 0.1  # [s]
LINE_EVERY = 10.0  # [s], where there is no terminal


class ProgressDisplay:
    """Shows each `Progress` it is called with; a context that leaves a clean line behind.

    Parameters
    ----------
    stream : TextIO
        Standard error, mostly. If it is no terminal it gets a line now and then.
    quiet : bool
        Show nothing.
    """

    def __init__(self, stream: TextIO, *, quiet: bool = False) -> None:
        self._stream = stream
        self._quiet = quiet
        self._terminal = stream.isatty() and os.environ.get("TERM") != "dumb"
        self._bar: Bar | None = None
        self._shown = 0.0  # seconds of the render when something was last shown
        self._seconds = float("inf")  # of the render when it was last heard of

    def __enter__(self) -> ProgressDisplay:
        """Show nothing yet."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def __call__(self, progress: Progress) -> None:
        """Show where the render is, unless it was shown just now."""
        if self._quiet:
            return
        if progress.stage == "compile":
            self._compiling(progress)
            return
        another = progress.seconds < self._seconds  # such as that of an AOV's colours
        self._seconds = progress.seconds
        if another:
            self._shown = 0.0
        if progress.done == progress.resumed:
            if another and not self._terminal:
                self._line(_announcement(progress))
        elif not self._terminal:
            if progress.seconds - self._shown >= LINE_EVERY:
                self._shown = progress.seconds
                self._line(f"{progress.done / progress.total:.0%}, {_speed(progress)}")
        elif progress.seconds >= BAR_AFTER and progress.seconds - self._shown >= BAR_EVERY:
            self._shown = progress.seconds
            self._show_bar(progress)

    def _compiling(self, progress: Progress) -> None:
        if progress.done == 0:
            self._line("compiling kernels for this scene (once; cached)...")
        else:
            self._line(f"compiled in {progress.seconds:.1f} s")

    def _line(self, text: str) -> None:
        self._stream.write(f"{text}\n")
        self._stream.flush()

    def _show_bar(self, progress: Progress) -> None:
        if self._bar is None:
            self._bar = _make_bar(self._stream)
            self._bar.add_task("rendering", speed="")
            self._bar.start()
        task = self._bar.task_ids[0]
        self._bar.update(
            task, completed=progress.done, total=progress.total, speed=_speed(progress)
        )


def _announcement(progress: Progress) -> str:
    known = "until the goal is reached"
    resumed, total = progress.resumed, progress.total
    if progress.error is not None:
        return (
            f"going on after {resumed} samples {known}" if resumed else f"rendering {known}"
        )
    if resumed:
        return f"going on at {resumed / total:.0%} of {total} samples"
    return f"rendering {total} samples"


def _speed(progress: Progress) -> str:
    rate = (progress.done - progress.resumed) / progress.seconds
    others = f"; {progress.cluster}" if progress.cluster else ""
    if rate == 0.0 or progress.error == float("inf"):
        return f"{rate / 1e6:.1f} Msamples/s{others}"
    left = (progress.total - progress.done) / rate
    error = "" if progress.error is None else f"error {progress.error:.2%}, "
    return f"{error}{_duration(left)} left, {rate / 1e6:.1f} Msamples/s{others}"


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def _make_bar(stream: TextIO) -> Bar:
    # here, because rich takes 0.1 s that short renders need not wait for
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn
    from rich.progress import Progress as Bar

    return Bar(
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TaskProgressColumn(),
        TextColumn("{task.fields[speed]}"),
        console=Console(file=stream),
        transient=True,
    )

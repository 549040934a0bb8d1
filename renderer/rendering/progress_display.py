"""Progress of a render, and its display: a bar with the remaining time, or plain lines.

Terminals and notebooks get a bar; any other stream gets a line at intervals.
"""

from __future__ import annotations

import html
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:  # needs Numba
    from renderer.integrators.kind import Shown

BAR_AFTER = 0.3  # [s] shorter renders have no bar
BAR_EVERY = 0.1  # [s]
LINE_EVERY = 10.0  # [s] between lines if there is no bar


@dataclass(frozen=True)
class Progress:
    """Progress of a render, passed to the `progress` callback.

    There is no stage "compile" if all kernels are in the cache. The callback may raise
    KeyboardInterrupt, which ends the render like Ctrl-C.
    """

    stage: str  # "compile" with done = 0, then 1, of 1; then "render"
    done: int  # samples so far
    total: int
    seconds: float  # in this stage
    # estimated error, if a goal needs it: infinite before the first check
    error: float | None = None
    resumed: int = 0  # samples of `done` that come from the checkpoint
    cluster: str = ""  # a line about the workers
    # Returns the picture and the AOVs so far; this develops the film. To be called by the
    # callback, in its thread.
    picture: Callable[[], Shown] | None = None


@contextmanager
def shown(
    progress: Callable[[Progress], None] | bool | None,
) -> Iterator[Callable[[Progress], None] | None]:
    """Yield the callback for the `Progress` of a render, within a context.

    Parameters
    ----------
    progress : callable, bool, optional
        True: a `ProgressDisplay` on standard error. False and None: no display.

    Raises
    ------
    TypeError
        If it has another type.
    """
    if not (progress is None or isinstance(progress, bool) or callable(progress)):
        raise TypeError(
            f"progress is of type {type(progress).__name__}; possible are True, False, "
            "None and what can be called with a Progress"
        )
    if progress is True and sys.stderr is not None:
        with ProgressDisplay(sys.stderr) as display:
            yield display
    else:
        yield None if isinstance(progress, bool) else progress


class ProgressDisplay:
    """Displays the `Progress` that it is called with; the context removes the bar.

    Parameters
    ----------
    stream : TextIO
        Usually standard error. If it is not a terminal, it gets a line at intervals.
    quiet : bool
        Show nothing.
    """

    def __init__(self, stream: TextIO, *, quiet: bool = False) -> None:
        self._stream = stream
        self._quiet = quiet
        self._bar: _TerminalBar | _NotebookBar | None = None
        if is_notebook():
            self._bar = _NotebookBar()
        elif stream.isatty() and os.environ.get("TERM") != "dumb":
            self._bar = _TerminalBar(stream)
        self._shown = 0.0  # [s] time of the render at the last display
        self._seconds = float("inf")  # [s] time of the render at the last call

    def __enter__(self) -> ProgressDisplay:
        """Return the display; nothing is shown yet."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, progress: Progress) -> None:
        """Show the progress, unless it was shown shortly before."""
        if self._quiet:
            return
        try:
            self._show(progress)
        except (OSError, ValueError):  # the stream is closed, or its disk is full
            self._quiet = True

    def _show(self, progress: Progress) -> None:
        if progress.stage == "compile":
            self._compiling(progress)
            return
        another = progress.seconds < self._seconds  # a new render, such as an AOV's colours
        self._seconds = progress.seconds
        if another:
            self._shown = 0.0
        if progress.done == progress.resumed:
            if another and self._bar is None:
                self._line(_announcement(progress))
        elif self._bar is None:
            if progress.seconds - self._shown >= LINE_EVERY:
                self._shown = progress.seconds
                self._line(f"{progress.done / progress.total:.0%}, {_speed(progress)}")
        elif progress.seconds >= BAR_AFTER and progress.seconds - self._shown >= BAR_EVERY:
            self._shown = progress.seconds
            self._bar.show(progress.done, progress.total, _speed(progress))

    def _compiling(self, progress: Progress) -> None:
        if progress.done == 0:
            self._line("compiling kernels for this scene (once; cached)...")
        else:
            self._line(f"compiled in {progress.seconds:.1f} s")

    def _line(self, text: str) -> None:
        self._stream.write(f"{text}\n")
        self._stream.flush()


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
    if (left := time_left(progress)) is None:
        return f"{shown_rate(rate)}{others}"
    error = "" if progress.error is None else f"error {progress.error:.2%}, "
    return f"{error}{_duration(left)} left, {shown_rate(rate)}{others}"


def shown_rate(rate: float) -> str:
    """Return samples per second in words; the textbook path tracer has some thousands."""
    return f"{rate:.0f} samples/s" if rate < 1e5 else f"{rate / 1e6:.1f} Msamples/s"


def time_left(progress: Progress) -> float | None:
    """Return the estimated remaining seconds; None if unknown."""
    done = progress.done - progress.resumed
    if done <= 0 or progress.error == float("inf") or progress.stage != "render":
        return None
    return (progress.total - progress.done) * progress.seconds / done


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


class _TerminalBar:
    """A bar of `rich`, imported on first use: that takes 0.1 s."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._bar: Any = None

    def show(self, done: int, total: int, text: str) -> None:
        if self._bar is None:
            from rich.console import Console
            from rich.progress import BarColumn, TaskProgressColumn, TextColumn
            from rich.progress import Progress as Bar

            self._bar = Bar(
                TextColumn("rendering"),
                BarColumn(bar_width=30),
                TaskProgressColumn(),
                TextColumn("{task.fields[text]}"),
                console=Console(file=self._stream),
                transient=True,
            )
            self._bar.add_task("", text="")
            self._bar.start()
        task = self._bar.task_ids[0]
        self._bar.update(task, completed=done, total=total, text=text)

    def stop(self) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


class _NotebookBar:
    """An HTML bar below the cell; that of `rich` would need the package ipywidgets."""

    def __init__(self) -> None:
        self._shown: Any = None

    def show(self, done: int, total: int, text: str) -> None:
        from IPython.display import HTML, display

        bar = f'<progress value="{done}" max="{total}"></progress>'
        content = HTML(f"rendering {bar} {done / total:.0%} {html.escape(text)}")
        if self._shown is None:
            self._shown = display(content, display_id=True)
        else:
            self._shown.update(content)

    def stop(self) -> None:
        if self._shown is not None:
            from IPython.display import HTML

            self._shown.update(HTML(""))
            self._shown = None


def is_notebook() -> bool:
    """Return whether Jupyter runs this process: its shell has a kernel."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")

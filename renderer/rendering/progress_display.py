"""Where a render is, and how it is shown: a bar with the time left, or plain lines.

A terminal and a notebook have a bar, anything else gets a line now and then.
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

BAR_AFTER = 0.3  # [s]; a render that is over by then needs no bar
BAR_EVERY = 0.1  # [s]
LINE_EVERY = 10.0  # [s], where there is no bar


@dataclass(frozen=True)
class Progress:
    """Where a render is: handed to the `progress` callback.

    There is no stage "compile" when all kernels are in the cache. The callback may raise
    KeyboardInterrupt, which ends the render as Ctrl-C does.
    """

    stage: str  # "compile", done 0 and then 1 of 1, then "render"
    done: int  # samples so far
    total: int
    seconds: float  # in this stage
    # of the picture so far, where a goal needs it: infinite before it is known
    error: float | None = None
    resumed: int = 0  # samples of `done` that were in the checkpoint
    cluster: str = ""  # a line about its workers and what they did
    # gives the picture and the AOVs so far, at the price of developing the film; to be
    # called by the callback, in its thread
    picture: Callable[[], Shown] | None = None


@contextmanager
def shown(
    progress: Callable[[Progress], None] | bool | None,
) -> Iterator[Callable[[Progress], None] | None]:
    """Give what is called with the `Progress` of a render; the bar goes with the context.

    Parameters
    ----------
    progress : callable, bool, optional
        True: a `ProgressDisplay` on standard error. False and None: nothing.

    Raises
    ------
    TypeError
        If it is something else.
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
        self._bar: _TerminalBar | _NotebookBar | None = None
        if is_notebook():
            self._bar = _NotebookBar()
        elif stream.isatty() and os.environ.get("TERM") != "dumb":
            self._bar = _TerminalBar(stream)
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

    def __call__(self, progress: Progress) -> None:
        """Show where the render is, unless it was shown just now."""
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
        another = progress.seconds < self._seconds  # such as that of an AOV's colours
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
    """Return samples per second in words; the simple path tracer has some thousands."""
    return f"{rate:.0f} samples/s" if rate < 1e5 else f"{rate / 1e6:.1f} Msamples/s"


def time_left(progress: Progress) -> float | None:
    """Return the seconds that a render will probably still take; None: no idea yet."""
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
    """A bar of `rich`, which is imported with the first: it takes 0.1 s."""

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
    """A bar of HTML below the cell; that of `rich` needs the package ipywidgets."""

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
    """Tell whether Jupyter runs this process: its shell has a kernel, a terminal's not."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")

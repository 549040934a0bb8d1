"""`lightproof --compile`: all kernels at once, so that no picture waits for one."""

from __future__ import annotations

import sys
import time

from renderer.process.signals import output_is_lost
from renderer.rendering.progress_display import LINE_EVERY


def compile_kernels(*, quiet: bool) -> int:
    """Compile every kernel that is not in the cache yet; return the exit status.

    A terminal has a bar, anything else a line now and then.

    Raises
    ------
    SceneError
        If the cache cannot be written.
    """
    # Numba takes half a second, and rich a tenth, that other commands need not wait for
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from renderer.command.compile_ahead import compile_all

    began = said = time.monotonic()
    terminal = sys.stderr.isatty()
    bar = Progress(
        TextColumn("compiling kernels"),
        BarColumn(bar_width=30),
        TextColumn("{task.completed} of {task.total}"),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
        disable=quiet or not terminal,
    )
    task = bar.add_task("", total=None)

    def show(done: int, total: int) -> None:
        nonlocal said
        bar.update(task, completed=done, total=total)
        now = time.monotonic()
        if not (quiet or terminal) and (done == 0 or now - said >= LINE_EVERY):
            said = now
            sys.stderr.write(f"compiling kernels: {done} of {total} scenes\n")

    with bar:
        anew = compile_all(show)
    if not quiet:
        seconds = time.monotonic() - began
        sys.stdout.write(
            f"all kernels are compiled, in {seconds:.0f} s\n"
            if anew
            else "all kernels are compiled\n"
        )
    return int(output_is_lost())

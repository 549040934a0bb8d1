"""Ctrl-C while there is a picture to save: the first is noted, the second interrupts."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any

_HALF_DONE: list[BaseException] = []  # with their frames, and all that these hold


class Interrupts:
    """Counts Ctrl-C (SIGINT) while the context lasts.

    Each raises KeyboardInterrupt, as it does without this class, except the first one
    while `held` is true: a picture is then half done, or being written, and the code that
    works on it looks at `count` between two steps.

    Python loses what is raised in a callback of a weak reference or in a `__del__`, and
    prints it. Numba has such callbacks, and one interrupt of 200 fell into one of them: it
    comes again as soon as the callback is over.

    What an interrupt left half done is kept until the process ends: objects of LLVM that
    were half made failed when Python took them apart (one of 220), or crashed (one of 950).
    """

    def __init__(self) -> None:
        self.count = 0
        self.held = False
        self._previous: Any = None
        self._previous_hook: Any = None

    def __enter__(self) -> Interrupts:
        """Take over, unless there is another handler, or the process ignores interrupts."""
        is_main = threading.current_thread() is threading.main_thread()
        if is_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            self._previous_hook = sys.unraisablehook
            sys.unraisablehook = self._on_lost
            self._previous = signal.signal(signal.SIGINT, self._on_signal)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Give the signal back."""
        if self._previous is not None:
            if self.count and error is not None and _came_of_an_interrupt(error):
                _HALF_DONE.append(error)
            signal.signal(signal.SIGINT, self._previous)
            sys.unraisablehook = self._previous_hook

    @contextmanager
    def put_off(self) -> Iterator[None]:
        """Raise an interrupt after the block: C code being imported does not stand it.

        Of 350 interrupts two came out of an import as an ImportError.
        """
        self.held = True
        try:
            yield
        finally:
            self.held = False
        if self.count:
            raise KeyboardInterrupt

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.count += 1
        if self.count > 1 or not self.held:
            raise KeyboardInterrupt

    def _on_lost(self, lost: sys.UnraisableHookArgs) -> None:
        if not issubclass(lost.exc_type, KeyboardInterrupt):
            self._previous_hook(lost)
            return
        self.count -= 1
        _thread.start_new_thread(_interrupt_soon, ())


def _came_of_an_interrupt(error: BaseException | None) -> bool:
    """Return whether an error is an interrupt, or was raised while one passed."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _interrupt_soon() -> None:
    time.sleep(0.01)  # until the callback is over
    _thread.interrupt_main()

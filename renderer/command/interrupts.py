"""Ctrl-C while there is a picture to save: the first is noted, the second interrupts."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any


class Interrupts:
    """Counts Ctrl-C (SIGINT) while the context lasts.

    Each raises KeyboardInterrupt, as it does without this class, except the first one
    while `held` is true: a picture is then half done, or being written, and whoever works
    on it looks at `count` when it suits him.
    """

    def __init__(self) -> None:
        self.count = 0
        self.held = False
        self._previous: Any = None

    def __enter__(self) -> Interrupts:
        """Take over, unless somebody else did, or the process ignores interrupts."""
        is_main = threading.current_thread() is threading.main_thread()
        if is_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
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
            signal.signal(signal.SIGINT, self._previous)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.count += 1
        if self.count > 1 or not self.held:
            raise KeyboardInterrupt

"""Ctrl-C put off while C++ calls back into Python, through which no exception can pass."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def put_off_interrupts() -> Iterator[None]:
    """Hand SIGINT to whoever handles it after the block, not within.

    Other threads than the main one run no handlers, and need nothing.
    """
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    count = 0

    def note(number: int, frame: Any) -> None:
        nonlocal count
        count += 1

    signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        for _ in range(count):
            signal.raise_signal(signal.SIGINT)

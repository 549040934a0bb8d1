"""Detects compilation by Numba, which happens if the disk cache lacks a kernel."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import event


class CompilationWatch(event.Listener):  # type: ignore[misc]  # Numba has no types
    """Calls `announce` once, before the first kernel is compiled.

    Parameters
    ----------
    announce : callable
        Not called if every kernel comes from the cache.
    """

    def __init__(self, announce: Callable[[], None]) -> None:
        self._announce = announce
        self.compiled = False

    def on_start(self, event: Any) -> None:
        """Record that a compilation begins."""
        if not self.compiled:
            self.compiled = True
            self._announce()

    def on_end(self, event: Any) -> None:
        """Do nothing: nested kernels end before the outer one."""

    @contextmanager
    def installed(self) -> Iterator[None]:
        """Watch all compilations of the process within the context."""
        with event.install_listener("numba:compile", self):
            yield

"""Notice when Numba compiles, that is, when the cache on disk lacks a kernel."""

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
        Not called when every kernel comes from the cache.
    """

    def __init__(self, announce: Callable[[], None]) -> None:
        self._announce = announce
        self.compiled = False

    def on_start(self, event: Any) -> None:
        """Note that a compilation begins."""
        if not self.compiled:
            self.compiled = True
            self._announce()

    def on_end(self, event: Any) -> None:
        """Do nothing: the kernels inside a kernel end before it does."""

    @contextmanager
    def installed(self) -> Iterator[None]:
        """Watch all compilation of the process while the context lasts."""
        with event.install_listener("numba:compile", self):
            yield

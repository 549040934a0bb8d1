"""`--view` and `--tev`: what shows a picture while it is rendered, with the progress."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING, Protocol

from renderer.command.interrupts import Interrupts
from renderer.command.outputs import complain, default_output

if TYPE_CHECKING:  # needs Numba
    from renderer.rendering.picture.image import Image
    from renderer.rendering.progress_display import Progress


class Watcher(Protocol):
    """What is told how a render goes on."""

    def __call__(self, now: Progress) -> None:
        """Show where the render is."""

    def end(self, image: Image) -> None:
        """Show the picture, which is written already."""


@contextmanager
def open_watchers(
    options: argparse.Namespace, interrupts: Interrupts
) -> Iterator[Sequence[Watcher]]:
    """Give what `--view` and `--tev` request, and close it.

    Raises
    ------
    SceneError
        If no tev listens, or there is no port for a page.
    """
    found: list[Watcher] = []
    with ExitStack() as stack:
        title = default_output(options.scene).stem
        if options.tev is not None:
            with interrupts.put_off():
                from renderer.rendering.watching.tev import Tev
            host, port = options.tev
            found.append(stack.enter_context(Tev(host, port, title)))
        if options.view:
            with interrupts.put_off():
                from renderer.rendering.watching.live_page import LivePage
            page = stack.enter_context(LivePage(title))
            complain(f"view: {page.address}")
            _open_browser(page.address)
            found.append(page)
        yield found


def end_all(
    watchers: Sequence[Watcher], image: Image | None, interrupts: Interrupts
) -> None:
    """Show the picture, and wait until it is seen, or for Ctrl-C; there may be none."""
    interrupts.held = False
    with suppress(KeyboardInterrupt):
        if image is not None:
            for watcher in watchers:
                if not getattr(watcher, "was_opened", True):
                    complain(
                        "view: the page was not opened yet; Ctrl-C ends the wait for it"
                    )
                watcher.end(image)
    for watcher in watchers:
        if trouble := getattr(watcher, "trouble", ""):
            complain(f"warning: tev does not get the whole picture: {trouble}")


def _open_browser(address: str) -> None:
    """Open the page where there is a screen; a browser of the terminal would disturb."""
    if sys.platform in ("darwin", "win32") or {"DISPLAY", "WAYLAND_DISPLAY"} & set(
        os.environ
    ):
        import webbrowser

        webbrowser.open(address)

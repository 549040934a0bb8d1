"""`live=True`: a picture in a notebook that is updated during its render."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from renderer.errors import SceneError
from renderer.rendering.picture.image import Image
from renderer.rendering.progress_display import Progress, is_notebook, shown
from renderer.rendering.render_options import RenderOptions

EVERY = 1.0  # [s] minimum interval between two pictures
SHARE = 0.1  # maximum fraction of the render time spent on pictures
MISSING = (
    "live=True draws in a Jupyter notebook, and this is none; possible are progress=True "
    "and, on the command line, --view"
)
Show = Callable[[Progress], None]


@contextmanager
def watched(options: RenderOptions) -> Iterator[Show | None]:
    """Yield the callback for the `Progress` of a render, chosen by its options.

    Raises
    ------
    SceneError
        If `live` is requested outside of a notebook.
    """
    if options.live and not is_notebook():
        raise SceneError(MISSING)
    with shown(options.progress) as show:
        yield LivePicture(show) if options.live else show


class LivePicture:
    """Shows the picture of each `Progress` below the cell, where the last one stays.

    Parameters
    ----------
    show : callable, optional
        Also called with each `Progress`.
    """

    def __init__(self, show: Show | None) -> None:
        self._show = show
        self._next = 0.0  # [s] time of the next picture
        self._drawn: Any = None  # IPython's display handle

    def __call__(self, now: Progress) -> None:
        """Show the picture if its time has come, and when it is complete."""
        if self._show is not None:
            self._show(now)
        start = time.monotonic()
        whole = now.done == now.total
        if now.picture is None or now.done == 0 or (start < self._next and not whole):
            return
        content = Image(now.picture().pixels)._repr_png_()
        display = sys.modules["IPython.display"]
        picture = display.Image(content, format="png")
        if self._drawn is None:
            self._drawn = display.display(picture, display_id=True)
        else:
            self._drawn.update(picture)
        self._next = start + max(EVERY, (time.monotonic() - start) / SHARE)

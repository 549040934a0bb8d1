"""Complete pictures for measurements: an interrupted render is an error."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:  # needs Numba
    from renderer import Image


def whole(image: Image) -> Image:
    """Return a picture that has all its samples.

    Raises
    ------
    KeyboardInterrupt
        If it has not: `render` has answered Ctrl-C with the picture so far, which would be
        measured as one of more samples.
    """
    if not image.complete:
        raise KeyboardInterrupt
    return image

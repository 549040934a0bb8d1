"""The files that the pages of a folder share: plotly.js, and the bar that leads to them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from plotly.offline import get_plotlyjs

from mitsuba_ref.records.json_files import write_atomically
from reports.look.template import fill

LIBRARY, BAR = "plotly.js", "pages.js"


def write_shared_files(folder: Path, pages: Sequence[tuple[str, str]]) -> None:
    """Write what every page loads from its own folder.

    Parameters
    ----------
    folder
        Of the pages.
    pages
        (file, title), in the order of the bar; those that are not there are left out.
    """
    library = get_plotlyjs().encode()
    path = folder / LIBRARY
    if not (path.exists() and path.stat().st_size == len(library)):
        write_atomically(path, library)
    there = [page for page in pages if (folder / page[0]).exists()]
    write_atomically(folder / BAR, fill(BAR, pages=there).encode())

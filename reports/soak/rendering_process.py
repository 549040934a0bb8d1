"""A process that renders scenes in turn, and says after each round what memory it has."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from pathlib import Path
from typing import Any

import renderer
from reports.soak.damage.sound_files import SCENES

SIZE: dict[str, Any] = {"width": 32, "height": 24}


def main() -> None:
    """Render rounds until somebody ends this process; a line for each round.

    The argument is how many of the scenes, 0 for all. A line says how many pictures the
    round was, and the bytes of memory after it.
    """
    paths = sorted(SCENES.glob("*/scene.xml"))
    paths = paths[: int(sys.argv[1]) or len(paths)]
    while True:
        for path in paths:
            scene = renderer.load_file(path, **SIZE)
            renderer.render(scene, spp=1, threads=2)
            renderer.render(scene, spp=1, seed=1, threads=1)
        gc.collect()
        _give_back()
        sys.stdout.write(f"{2 * len(paths)} {_resident()}\n")
        sys.stdout.flush()


def _give_back() -> None:
    """Let the C library give free memory back, so that what is left is in use."""
    if hasattr(library := ctypes.CDLL(None), "malloc_trim"):
        library.malloc_trim(0)


def _resident() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


if __name__ == "__main__":
    main()

"""Files of plugins (`--plugins FILE.py`) that go to the workers with a scene.

A description may hold records of classes that such a file defines. So the files are the
first thing in what is sent, and reading them imports them, before the scene is read.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path

from renderer.kernels.jit.cache import cache_root, with_neighbours
from renderer.scene_file import plugin_file

Files = tuple[tuple[str, bytes], ...]  # names below a common folder, contents


class PluginFiles:
    """The plugin files of this process, by content: pickled, they are imported there."""

    def __reduce__(self) -> tuple[Callable[..., None], tuple[tuple[Files, ...]]]:
        """Say what a worker calls instead of making this object again."""
        return import_sent, (tuple(_contents(path) for path in plugin_file.imported),)


def _contents(path: str) -> Files:
    """Return a file, first, and what it imports from beside it."""
    files = with_neighbours(path)
    folder = os.path.commonpath([file.parent for file in files])
    return tuple((f.relative_to(folder).as_posix(), f.read_bytes()) for f in files)


def import_sent(plugins: tuple[Files, ...]) -> None:
    """Write files that came into a folder named by their content, and import the first.

    Raises
    ------
    SceneError
        If one cannot be imported here.
    """
    have = {_contents(path) for path in plugin_file.imported}
    for files in plugins:
        if files in have:  # this process sent them, or has had them
            continue
        digest = hashlib.sha256(repr(files).encode()).hexdigest()[:16]
        folder = cache_root() / "plugins" / digest
        for name, content in files:
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            part = path.with_name(f".{path.name}.{os.getpid()}.part")
            part.write_bytes(content)
            os.replace(part, path)  # other workers of the machine write the same
        plugin_file.import_plugin_file(str(folder / Path(files[0][0])))

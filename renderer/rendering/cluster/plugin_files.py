"""Files of plugins (`--plugins FILE.py`) that go to the workers with a scene.

A description may hold records of classes that such a file defines. So the files are the
first thing in what is sent, and reading them imports them, before the scene is read.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path

from renderer.errors import SceneError
from renderer.kernels.jit import with_neighbours
from renderer.process.cache_folder import cache_folder, cache_root
from renderer.process.whole_file import write_whole
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
        If one cannot be imported here, or if this process has imported another content
        under a name of theirs: Python would go on with that.
    """
    have = {_contents(path) for path in plugin_file.imported}
    for files in plugins:
        if files in have:  # this process sent them, or has had them
            continue
        _refuse_stale(files)
        digest = hashlib.sha256(repr(files).encode()).hexdigest()[:16]
        folder = cache_folder("plugins") / digest
        for name, content in files:
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, content)  # other workers of the machine write the same
        plugin_file.import_plugin_file(str(folder / Path(files[0][0])))


def _refuse_stale(files: Files) -> None:
    """Refuse files in the place of which modules with another content are loaded."""
    plugin = Path(files[0][0])
    sent = cache_root() / "plugins"
    for name, content in files:
        parts = Path(os.path.relpath(name, plugin.parent)).with_suffix("").parts
        module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        if name == files[0][0]:
            module = plugin_file.module_name(plugin)
        loaded = getattr(sys.modules.get(module), "__file__", None)
        if loaded is None:
            continue
        # beside a plugin, what has the name of a library's module is not what is imported
        ours = name == files[0][0] or Path(loaded).is_relative_to(sent)
        if ours and (not os.path.isfile(loaded) or Path(loaded).read_bytes() != content):
            raise SceneError(
                f"{Path(name).name} is not what this worker has imported under that name; "
                "restart the workers"
            )

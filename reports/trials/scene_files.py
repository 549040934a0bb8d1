"""The scenes of this repository, by name."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

from renderer.errors import SceneError
from renderer.scene_file import read_file
from reports.errors import OptionError

SCENES = Path(__file__).resolve().parents[2] / "scenes"


def scene_names() -> list[str]:
    """Return the names of the scenes."""
    return sorted(path.parent.name for path in SCENES.glob("*/scene.xml"))


def scene_file(given: str) -> Path:
    """Return the scene file for a path, a folder, or the name of one of scenes/.

    Raises
    ------
    OptionError
        If there is no such file.
    """
    for place in (Path(given), SCENES / given):
        file = place / "scene.xml" if place.is_dir() else place
        if file.is_file():
            return file.resolve()
    names = ", ".join(scene_names())
    raise OptionError(f"scene {given!r}: no such file; names of scenes are {names}")


def scene_content(case: str, parameters: Mapping[str, str] | None = None) -> str:
    """Return a hash of every file that a scene reads; "" if it cannot be read.

    Of the paths only the last names count, so that a clone elsewhere has the same.
    """
    digest = hashlib.sha256()
    try:
        for file in map(Path, read_file(scene_file(case), **(parameters or {})).files):
            held = file.read_bytes()
            digest.update(f"{file.name}\0{len(held)}\0".encode() + held)
    except (SceneError, OptionError, OSError):
        return ""
    return digest.hexdigest()[:32]

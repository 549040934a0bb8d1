"""The scenes of this repository, by name."""

from __future__ import annotations

from pathlib import Path

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

"""The scenes that are installed with the program.

They are folders of scenes/, which `renderer/demo_scenes` links to; a wheel has copies.
"""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).parents[1] / "demo_scenes"


def demos() -> list[str]:
    """Return the names of the scenes."""
    return sorted(path.parent.name for path in FOLDER.glob("*/scene.xml"))


def list_of_demos() -> str:
    """Return a line for each scene: its name, and the first sentence of its README."""
    width = max(map(len, demos()), default=0)
    return "\n".join(f"  {name:<{width}}  {_sentence(name)}" for name in demos())


def _sentence(name: str) -> str:
    lines = (FOLDER / name / "README.md").read_text(encoding="utf-8").splitlines()
    return next(line for line in lines[1:] if line.strip())

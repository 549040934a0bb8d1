"""lightproof's renderer: reads Mitsuba 3 scenes and renders them with its own kernels.

>>> import renderer
>>> scene = renderer.load_file("scenes/cornell-box/scene.xml", spp=16)
>>> image = renderer.render(scene)
>>> image.save("cornell.exr")
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

from renderer.errors import SceneError
from renderer.image import Image
from renderer.render import render
from renderer.rendering import Progress
from renderer.scene import Scene, build_scene
from renderer.scene_file import SceneDescription, read_dict, read_file, read_string

__version__ = "0.1.0"
__all__ = [
    "Image",
    "Progress",
    "Scene",
    "SceneError",
    "load_dict",
    "load_file",
    "load_string",
    "render",
]


def load_file(path: str | Path, /, **parameters: object) -> Scene:
    """Load a Mitsuba 3 XML scene; keyword arguments replace the file's `<default>` values.

    What the file says but the picture does not follow, such as triangles without area that
    are dropped, goes to the logger "renderer" as warnings.

    Raises
    ------
    SceneError
        With file, line, plugin and property, if the scene cannot be rendered.
    """
    return _logged(read_file(path, **parameters))


def load_string(
    xml: str, /, *, base_dir: str | Path | None = None, **parameters: object
) -> Scene:
    """Load a scene from XML text; files it names are looked up in `base_dir`."""
    return _logged(read_string(xml, base_dir=base_dir, **parameters))


def load_dict(scene: dict[str, Any], *, base_dir: str | Path | None = None) -> Scene:
    """Load a scene from a dictionary of the form that Mitsuba's `load_dict` takes."""
    return _logged(read_dict(scene, base_dir=base_dir))


def _logged(description: SceneDescription) -> Scene:
    """Build a scene and log what its reader noticed.

    Not in the reader: the command line prints the same lines in a form of its own.
    """
    scene = build_scene(description)
    for warning in description.warnings:
        logging.getLogger(__name__).warning("%s", warning)
    return scene

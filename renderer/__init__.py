"""lightproof's renderer: reads Mitsuba 3 scenes and renders them with its own kernels.

>>> import renderer
>>> scene = renderer.load_file("scenes/cornell-box/scene.xml", spp=16)
>>> image = renderer.render(scene)
>>> image.save("cornell.exr")
"""

from __future__ import annotations

import importlib
import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

from renderer.process.names import VERSION

if TYPE_CHECKING:
    from renderer.errors import ClusterError, SceneError
    from renderer.kernels.jit import kernel
    from renderer.plugins.bsdfs.registry import register_bsdf
    from renderer.rendering.picture.image import Image
    from renderer.rendering.progress_display import Progress
    from renderer.rendering.render import render, render_frames
    from renderer.rendering.render_to_file import render_to_file
    from renderer.scene.scene import Scene
    from renderer.scene_file import Folders, SceneDescription
    from renderer.scene_file.transform_functions import look_at, rotate, scale, translate

__version__ = VERSION
__all__ = [
    "ClusterError",
    "Image",
    "Progress",
    "Scene",
    "SceneError",
    "kernel",
    "load_dict",
    "load_file",
    "load_string",
    "look_at",
    "register_bsdf",
    "render",
    "render_frames",
    "render_to_file",
    "rotate",
    "scale",
    "simplify",
    "translate",
]

# Imported on first use: importing Numba takes half a second, and the version, the command's
# help and a scene's description do not need it.
_MODULES = {
    "ClusterError": "renderer.errors",
    "Image": "renderer.rendering.picture.image",
    "Progress": "renderer.rendering.progress_display",
    "Scene": "renderer.scene.scene",
    "SceneError": "renderer.errors",
    "kernel": "renderer.kernels.jit",
    "look_at": "renderer.scene_file.transform_functions",
    "register_bsdf": "renderer.plugins.bsdfs.registry",
    "render": "renderer.rendering.render",
    "render_frames": "renderer.rendering.render",
    "render_to_file": "renderer.rendering.render_to_file",
    "rotate": "renderer.scene_file.transform_functions",
    "scale": "renderer.scene_file.transform_functions",
    "translate": "renderer.scene_file.transform_functions",
}


def __getattr__(name: str) -> Any:
    """Import a public name from its module and keep it."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names too that are not imported yet."""
    return sorted({*globals(), *__all__})


def load_file(
    path: str | Path,
    /,
    *,
    allow_outside: Folders = (),
    memory: int | float | str | None = None,
    **parameters: object,
) -> Scene:
    """Load a Mitsuba 3 XML scene; keyword arguments replace the file's `<default>` values.

    What the file says but the picture does not follow, such as triangles without area that
    are dropped, goes to the logger "renderer" as warnings.

    Parameters
    ----------
    path
        The file.
    allow_outside
        A folder, or several, in whose trees the scene may name files too: what lies in none
        of them and not in that of the scene's own folder is not read (docs/security.md).
    memory
        The most memory that this process may have meanwhile, in bytes or such as "4GiB";
        None: what the machine has free. A file that would take more is refused.
    **parameters
        Values for `$name` in the file.

    Raises
    ------
    SceneError
        With file, line, plugin and property, if the scene cannot be rendered.
    """
    from renderer.process.memory import limited_to
    from renderer.scene_file import read_file_with

    with limited_to(memory):
        return _logged(read_file_with(path, parameters, allow_outside))


def load_string(
    xml: str,
    /,
    *,
    base_dir: str | Path | None = None,
    allow_outside: Folders = (),
    memory: int | float | str | None = None,
    **parameters: object,
) -> Scene:
    """Load a scene from XML text; files it names are looked up in `base_dir`.

    The other arguments are those of `load_file`; the scene's own folder is `base_dir`, or
    without one the working directory.
    """
    from renderer.process.memory import limited_to
    from renderer.scene_file import read_string

    with limited_to(memory):
        return _logged(
            read_string(xml, base_dir=base_dir, allow_outside=allow_outside, **parameters)
        )


def load_dict(
    scene: dict[str, Any],
    *,
    base_dir: str | Path | None = None,
    allow_outside: Folders | None = None,
    memory: int | float | str | None = None,
) -> Scene:
    """Load a scene from a dictionary of the form that Mitsuba's `load_dict` takes.

    The other arguments are those of `load_string`, but that files may lie anywhere unless
    `allow_outside` is given (it may be empty): a dictionary is a program's own.

    A transform is a 4 x 4 matrix that acts on column vectors: what `look_at`, `translate`,
    `rotate` and `scale` return, or a product of them (`@`), whose right factor acts first.
    """
    from renderer.process.memory import limited_to
    from renderer.scene_file import read_dict

    with limited_to(memory):
        return _logged(read_dict(scene, base_dir=base_dir, allow_outside=allow_outside))


def simplify(scene: Scene, *words: str) -> Scene:
    """Return a scene with less in it, one simplification after the other.

    Parameters
    ----------
    scene : Scene
        From `load_file`, `load_string` or `load_dict`; it stays as it is.
    *words
        Such as `depth=3`, `textures=mean` or `no-light=lamp`: what `--simplify` takes.

    Raises
    ------
    SceneError
        For a name or a value that does not exist in this scene.
    """
    from renderer.advice.simplifications import simplified
    from renderer.scene.scene import build_scene

    description = scene.description
    for word in words:
        description = simplified(description, word)
    return build_scene(description)


def _logged(description: SceneDescription) -> Scene:
    """Build a scene and log what its reader noticed.

    Not in the reader: the command line prints the same lines in a form of its own.
    """
    from renderer.scene.scene import build_scene

    scene = build_scene(description)
    for warning in description.warnings:
        logging.getLogger(__name__).warning("%s", warning)
    return scene

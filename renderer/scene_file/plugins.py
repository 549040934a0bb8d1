"""The supported plugins, by tag."""

from __future__ import annotations

import functools
import importlib
import importlib.util
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from renderer.errors import PluginError, SceneError, did_you_mean
from renderer.process.source_places import place_of_error

_SUPPORTED: dict[str, tuple[str, ...]] = {
    "scene": ("scene",),
    "integrator": (),
    "sensor": (),
    "film": ("hdrfilm",),
    "rfilter": ("box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"),
    "sampler": ("independent", "stratified", "multijitter", "orthogonal", "ldsampler"),
    "shape": ("shapegroup", "instance"),
    "bsdf": (),
    "texture": ("srgb", "d65", "rawconstant", "regular", "irregular", "blackbody"),
    "emitter": (),
    "medium": ("homogeneous", "heterogeneous"),
    "phase": ("isotropic", "hg", "rayleigh", "tabphase", "blendphase"),
    "volume": ("constvolume", "gridvolume"),
}  # and the registered ones, see `registered_kinds`
# Objects of Mitsuba that are not supported; errors name them.
UNSUPPORTED_TAGS = ("field",)
TAGS = (*_SUPPORTED, *UNSUPPORTED_TAGS, "spectrum")


# Kinds that functions in their own files read. Those files import this package and contain
# kernels. They are imported when a scene is read, so that a program that reads no scene
# does not wait for Numba.
_REGISTRIES = {
    "bsdf": ("renderer.plugins.bsdfs.registry", "PLUGINS"),
    "emitter": ("renderer.plugins.lights.registry", "LIGHTS"),
    "sensor": ("renderer.plugins.sensors.registry", "SENSORS"),
    "shape": ("renderer.plugins.shapes.registry", "PLUGINS"),
    "integrator": ("renderer.integrators.registry", "IN_FILES"),
    "texture": ("renderer.plugins.textures.registry", "TEXTURES"),
}


def registered_kinds(tag: str) -> Mapping[str, Any]:
    """Return the kinds of a tag that their own files read, by plugin name.

    Each has `read`, which returns the description from the properties of a file.
    """
    if tag not in _REGISTRIES:
        return {}
    module, name = _REGISTRIES[tag]
    kinds: Mapping[str, Any] = getattr(importlib.import_module(module), name)
    return kinds


def supported_plugins(tag: str) -> tuple[str, ...]:
    """Return the plugins of a tag; none for a tag that is not supported."""
    return (*registered_kinds(tag), *_SUPPORTED.get(tag, ()))


def varying_textures() -> set[str]:
    """Return the textures that vary over a surface."""
    return set(registered_kinds("texture")) - {"uniform"}


def tag_of_plugin(plugin: str) -> str | None:
    """Return the tag of a plugin, None for an unsupported one."""
    return next((tag for tag in _SUPPORTED if plugin in supported_plugins(tag)), None)


def every_plugin() -> list[str]:
    """Return the names of all plugins that are supported."""
    return [plugin for tag in _SUPPORTED for plugin in supported_plugins(tag)]


def supported_tags() -> tuple[str, ...]:
    """Return the tags that have plugins."""
    return tuple(_SUPPORTED)


# -------------------------------------------------------------------------- plugin file
# A user's file of plugins (`--plugins FILE.py`), which registers them when it is
# imported.
#
# A comparison with another renderer imports the same file in that renderer's process too.

imported: list[str] = []  # absolute paths of imported files
# the names that each of them registers; Mitsuba's own registry has no list of names
registered_by: dict[str, tuple[str, ...]] = {}


@contextmanager
def neighbours_importable(path: str) -> Iterator[None]:
    """Let a plugin file import modules of its folder, as a script does."""
    folder = str(Path(path).resolve().parent)
    sys.path.insert(0, folder)
    try:
        yield
    finally:
        sys.path.remove(folder)


def module_name(file: Path) -> str:
    """Return the name in `sys.modules` of a plugin file."""
    return f"lightproof_plugins_{file.stem}"


@functools.cache
def import_plugin_file(path: str) -> ModuleType:
    """Return the module of a plugin file, run once in each process.

    Raises
    ------
    PluginError
        If it cannot be read, or raises; one line that names the file and the line.
    """
    file = Path(path)
    name = module_name(file)
    specification = importlib.util.spec_from_file_location(name, file)
    if specification is None or specification.loader is None:
        raise PluginError("expected a Python file of plugins, NAME.py", path)
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module  # dataclasses look up their module there
    before = dict(registered_kinds("bsdf"))
    try:
        with neighbours_importable(path):
            specification.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # also scripts that call sys.exit
        del sys.modules[name]
        raise plugin_error(error, path) from error
    absolute = str(file.resolve())
    imported.append(absolute)
    registered_by[absolute] = tuple(
        name
        for name, kind in registered_kinds("bsdf").items()
        if before.get(name) is not kind
    )
    return module


def plugin_error(error: BaseException, path: str, what: str = "") -> PluginError:
    """Return an exception of a user's file as one line with its place.

    Parameters
    ----------
    error
        Errors of this renderer keep their text; others are named by their class.
    path
        The plugin file, named if no line of a user's file is known.
    what
        Such as "register_mitsuba(): ".
    """
    if isinstance(error, PluginError) and error.place:
        return error
    said = error.msg if isinstance(error, SyntaxError) else str(error)
    if not isinstance(error, SceneError):
        said = f"{type(error).__name__}: {said}{_similar_name(error)}"
    return PluginError(f"{what}{' '.join(said.split())}", place_of_error(error) or path)


def _similar_name(error: BaseException) -> str:
    """Return "; did you mean ...?" if a module has a name similar to the missing one."""
    for pattern in (
        r"cannot import name '(?P<name>\w+)' from '(?P<module>[\w.]+)'",
        r"module '(?P<module>[\w.]+)' has no attribute '(?P<name>\w+)'",
    ):
        if (match := re.search(pattern, str(error))) and match["module"] in sys.modules:
            return did_you_mean(match["name"], dir(sys.modules[match["module"]]))
    return ""

"""The plugins that are supported, by what they are for."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

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
}  # and what is registered, see `registered_kinds`
# Objects that Mitsuba has and this renderer has not; the reader says so by their name.
UNSUPPORTED_TAGS = ("medium", "phase", "volume", "field")
TAGS = (*_SUPPORTED, *UNSUPPORTED_TAGS, "spectrum")


# Kinds that are read by functions of their own files. Those files import this package and
# hold kernels. They are loaded by name when a scene is read, like any plugin, so that a
# program that reads no scene does not wait for Numba.
_REGISTRIES = {
    "bsdf": ("renderer.plugins.bsdfs.registry", "PLUGINS"),
    "emitter": ("renderer.plugins.lights.registry", "LIGHTS"),
    "sensor": ("renderer.plugins.sensors.registry", "SENSORS"),
    "shape": ("renderer.plugins.shapes.registry", "PLUGINS"),
    "integrator": ("renderer.integrators.registry", "IN_FILES"),
    "texture": ("renderer.plugins.textures.registry", "TEXTURES"),
}


def registered_kinds(tag: str) -> Mapping[str, Any]:
    """Return the kinds of a tag that are read by their own files, by the plugin's name.

    Each has `read`, which makes the description from the properties of a file.
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
    """Return the textures that differ from point to point."""
    return set(registered_kinds("texture")) - {"uniform"}


def tag_of_plugin(plugin: str) -> str | None:
    """Return what a plugin is for, None for one that is not supported."""
    return next((tag for tag in _SUPPORTED if plugin in supported_plugins(tag)), None)


def every_plugin() -> list[str]:
    """Return the names of all plugins that are supported."""
    return [plugin for tag in _SUPPORTED for plugin in supported_plugins(tag)]


def supported_tags() -> tuple[str, ...]:
    """Return the tags that have plugins."""
    return tuple(_SUPPORTED)

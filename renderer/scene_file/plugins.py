"""The plugins that are supported, by what they are for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

_SUPPORTED: dict[str, tuple[str, ...]] = {
    "scene": ("scene",),
    "integrator": ("direct", "whitted", "path", "depth", "aov"),
    "sensor": ("perspective",),
    "film": ("hdrfilm",),
    "rfilter": ("box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"),
    "sampler": ("independent", "stratified", "multijitter", "orthogonal", "ldsampler"),
    "shape": (
        "obj",
        "ply",
        "rectangle",
        "cube",
        "sphere",
        "disk",
        "cylinder",
        "shapegroup",
        "instance",
    ),
    "bsdf": ("twosided",),  # and what is registered, see `bsdf_readers`
    "texture": ("bitmap", "checkerboard", "uniform", "srgb", "d65"),
    "emitter": ("area",),  # and what is registered, see `light_kinds`
}
# Objects that Mitsuba has and this renderer has not; the reader says so by their name.
_UNSUPPORTED_TAGS = ("medium", "phase", "volume", "field")
TAGS = (*_SUPPORTED, *_UNSUPPORTED_TAGS, "spectrum")


def bsdf_readers() -> Mapping[str, Callable[[Any], Any]]:
    """Return what reads each kind of BSDF from its properties, by the plugin's name.

    Imported here: the file of a kind holds how it is read, and what it needs for that is
    in this package.
    """
    from renderer.kinds.bsdfs.registry import BSDFS

    return {name: kind.read for name, kind in BSDFS.items()}


def light_kinds() -> Mapping[str, Any]:
    """Return the kinds of emitter that stand alone, by the plugin's name."""
    from renderer.kinds.lights.registry import LIGHTS

    return LIGHTS


def supported_plugins(tag: str) -> tuple[str, ...]:
    """Return the plugins of a tag; none for a tag that is not supported."""
    registered = {"bsdf": bsdf_readers, "emitter": light_kinds}.get(tag)
    return (*(registered() if registered else ()), *_SUPPORTED.get(tag, ()))


def tag_of_plugin(plugin: str) -> str | None:
    """Return what a plugin is for, None for one that is not supported."""
    return next((tag for tag in _SUPPORTED if plugin in supported_plugins(tag)), None)


def every_plugin() -> list[str]:
    """Return the names of all plugins that are supported."""
    return [plugin for tag in _SUPPORTED for plugin in supported_plugins(tag)]


def supported_tags() -> tuple[str, ...]:
    """Return the tags that have plugins."""
    return tuple(_SUPPORTED)

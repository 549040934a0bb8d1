"""The plugins that are supported, by what they are for."""

from __future__ import annotations

SUPPORTED: dict[str, tuple[str, ...]] = {
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
    "bsdf": ("diffuse", "twosided", "dielectric", "conductor"),
    "texture": ("bitmap", "checkerboard", "uniform", "srgb", "d65"),
    "emitter": ("point", "spot", "directional", "constant", "area"),
}
# Objects that Mitsuba has and this renderer has not; the reader says so by their name.
_UNSUPPORTED_TAGS = ("medium", "phase", "volume", "field")
TAGS = (*SUPPORTED, *_UNSUPPORTED_TAGS, "spectrum")

TAG_OF_PLUGIN = {plugin: tag for tag, plugins in SUPPORTED.items() for plugin in plugins}

"""Denoises a picture with Open Image Denoise, guided by albedo and normals.

The metadata of the picture say that it was denoised. The noisy colours are kept as the AOV
`noisy`, and the estimated error is that of the noisy colours.
"""

from __future__ import annotations

import dataclasses
from importlib.metadata import version
from types import ModuleType

import numpy as np

from renderer.errors import SceneError
from renderer.rendering.picture.image import Image
from renderer.rendering.planning.plan import Plan
from renderer.scene.scene import Scene
from renderer.scene_file.description import Integrator

MISSING = "denoising needs Open Image Denoise: pip install 'lightproof[denoise]'"
NOISY = "noisy"  # name of the AOV with the colours before denoising
NOTE = "denoised"  # in the metadata
# Samples per pixel of the guides; the network tolerates their noise (edges, depth of
# field). For three scenes with 16 samples the error was 7 % lower with 16 than with 4, and
# 0.3 % with 64.
SPP = 16
_GUIDES = Integrator("aov", aovs=(("albedo", "albedo"), ("normals", "sh_normal")))


def check_denoising(plan: Plan, has_colors: bool) -> None:
    """Refuse before the render what cannot be denoised after it.

    Raises
    ------
    SceneError
        If the denoiser is not installed, or the picture has no colours.
    """
    _library()
    colors = plan.kind.channels == 3 and not plan.kind.counts_work
    if not (has_colors or colors) or plan.moments is not None:
        raise SceneError(
            f"denoising needs a picture of colours, and {plan.method!r} gives other "
            "channels; possible is --integrator path"
        )


def guides_of(scene: Scene) -> Scene:
    """Return the scene whose picture is the albedo and normals of the first hit."""
    description = dataclasses.replace(scene.description, integrator=_GUIDES)
    return dataclasses.replace(scene, description=description)


def denoised(image: Image, guides: Image) -> Image:
    """Return the denoised picture; `guides` is the picture of `guides_of` its scene.

    Pixels that are not finite stay unchanged, so that they remain visible.
    """
    finite = np.isfinite(image.pixels).all(axis=2, keepdims=True)
    pixels = _library().denoise(
        np.where(finite, image.pixels, np.float32(0.0)),
        albedo=np.clip(guides.aovs["albedo"], 0.0, 1.0),
        normal=guides.aovs["normals"],
        hdr=True,
    )
    said = f"by Open Image Denoise (pyoidn {version('pyoidn')}) with albedo and normals"
    if image.error is not None:
        said += "; the error is that of the picture before"
    return dataclasses.replace(
        image,
        pixels=np.where(finite, pixels, image.pixels),
        aovs={**image.aovs, NOISY: image.pixels},
        aov_kinds={**image.aov_kinds, NOISY: "color"},
        metadata={**image.metadata, NOTE: said},
    )


def _library() -> ModuleType:
    try:
        import pyoidn
    except ModuleNotFoundError as error:
        if error.name != "pyoidn":
            raise
        raise SceneError(MISSING) from None
    found: ModuleType = pyoidn
    return found

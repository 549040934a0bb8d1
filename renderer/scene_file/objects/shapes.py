"""Shapes: what all have in common. Each kind's own file reads the rest."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scene_file import transforms
from renderer.scene_file.coordinate_limits import check_reach
from renderer.scene_file.description import Bsdf, ConstantTexture, Diffuse, Shape
from renderer.scene_file.objects.bsdfs import read_bsdf
from renderer.scene_file.objects.emitters import read_radiance
from renderer.scene_file.plugins import registered_kinds
from renderer.scene_file.properties import Properties
from renderer.scene_file.read_context import Reading
from renderer.scene_file.tree import Element

STRETCH = 1e-4  # relative difference of two axes that counts as rounding


def read_shape(element: Element, reading: Reading) -> Shape:
    """Read a `<shape>`.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    properties = Properties(element, reading)
    plugin = registered_kinds("shape")[element.plugin]
    # Mitsuba's own default is black, not grey, on a shape that shines.
    nested = properties.child("bsdf")
    emitter = properties.child("emitter")
    radiance = None if emitter is None else read_radiance(element, emitter, reading)
    bsdf: Bsdf
    if nested is not None:
        bsdf = read_bsdf(nested, reading)
    elif emitter is not None:
        bsdf = Diffuse(ConstantTexture((0.0, 0.0, 0.0)))
    else:
        bsdf = Diffuse()
    properties.number("silhouette_sampling_weight", 1.0)  # for derivatives only
    common = {
        "bsdf": bsdf,
        "radiance": radiance,
        "id": element.id,
        "location": element.location,
    }
    shape: Shape = plugin.read(properties, common)
    properties.finish()
    with np.errstate(all="ignore"):
        check_reach(plugin.kind.corners_of(shape), properties)
        has_area = radiance is None or _area(plugin.kind, shape) > 0.0
    if not has_area:
        raise SceneError(
            f"{element.location}: {element} emits light but has no area; "
            "expected an area that "
            "float32 can hold"
        )
    return shape


def _area(kind: Any, shape: Shape) -> np.float32:
    """Return the surface area, as float32: what Mitsuba and the kernels sample with."""
    surfaces = kind.surfaces([shape], 0)
    return np.float32(kind.areas(surfaces, np.arange(surfaces.end)).sum())


def placed(properties: Properties, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the product of transforms, if it is still usable."""
    if (reason := transforms.why_unusable(matrix)) is not None:
        raise SceneError(
            f"{properties.location}: {properties.element} cannot be placed: {reason}"
        )
    return matrix

"""Textures, BSDFs, emitters and shapes of a document, each by its plugin."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scene_file import transforms
from renderer.scene_file.colors.colors import Use, read_color, read_constant_plugin
from renderer.scene_file.coordinate_limits import check_place, check_reach
from renderer.scene_file.description import (
    Bsdf,
    ConstantTexture,
    Diffuse,
    Emitter,
    Location,
    Radiance,
    Shape,
    Texture,
)
from renderer.scene_file.files import Reading
from renderer.scene_file.images.image import Image, checked
from renderer.scene_file.images.images import READ_FROM, read_texels
from renderer.scene_file.objects.media import read_medium
from renderer.scene_file.plugins import registered_kinds, varying_textures
from renderer.scene_file.properties import Properties
from renderer.scene_file.tree import Element

# ------------------------------------------------------------------------------ nesting
# Limits for nested BSDFs and textures.


def check_nesting(element: Element, deepest: int) -> None:
    """Refuse an element with too deeply nested elements of the same tag.

    With references, a file of a few lines can contain 2^30 of them. A loop over them would
    not end in useful time.

    Raises
    ------
    SceneError
        If there are more than `deepest`.
    """
    depth, level = 0, {id(element): element}
    while level and depth <= deepest:
        depth += 1
        inside = (p.value for e in level.values() for p in e.properties.values())
        level = {
            id(e): e for e in inside if isinstance(e, Element) and e.tag == element.tag
        }
    if depth > deepest:
        raise SceneError(
            f"{element.location}: {element} nests more than {deepest} {element.tag}s; "
            f"at most {deepest} inside of one another are possible"
        )


# ----------------------------------------------------------------------------- pictures
# Images of textures and lights: a file, or pixels in a dictionary.


def read_picture(properties: Properties, inline: tuple[str, ...]) -> tuple[Image, str, str]:
    """Return an image, its name for messages, and the property that gives it.

    Entries of the file that are not applied become warnings.

    Parameters
    ----------
    inline
        Properties other than "filename" that may hold the pixels.

    Raises
    ------
    SceneError
        If no image is given, or it cannot be used.
    """
    there = [key for key in inline if key in properties.element.properties]
    if properties.has("filename") or not there:
        expected = f"the path of an image: {READ_FROM}"
        image, name = properties.file("the image", expected, _texels_and_name)
        for note in image.notes:
            properties.reading.warn(location_of(properties, "filename"), f"{name}: {note}")
        return image, name, "filename"
    key = there[0]
    property_ = properties.take(key)
    given = None if property_ is None else property_.value
    if not isinstance(given, Image):
        properties.fail(key, "no image", "an array of (height, width, channels)")
    try:
        return checked(given, key), key, key
    except SceneError as error:
        raise SceneError(f"{properties.location}: {properties.element}: {error}") from None


def location_of(properties: Properties, key: str) -> Location:
    """Return the location of a property that the element has."""
    return properties.element.properties[key].location


def _texels_and_name(path: Path) -> tuple[Image, str]:
    return read_texels(path), path.name


# ----------------------------------------------------------------------------- textures
# Textures: parameters that may vary over the surface, read by their kinds.

DEEPEST_TEXTURE = 12  # levels of nested textures; a checkerboard contains two


def read_texture(
    properties: Properties, name: str, default: float, use: Use = Use.REFLECTANCE
) -> Texture:
    """Return the texture of a colour property; a plain colour is one too.

    Parameters
    ----------
    default
        Grey value for an absent property.
    use
        Limits the possible constant colours.

    Raises
    ------
    SceneError
        If it is neither a colour nor a texture, or its image cannot be used.
    """
    texture = _varying(properties, name, use)
    if texture is not None:
        return texture
    return ConstantTexture(read_color(properties, name, default, use))


def read_scalar_texture(
    properties: Properties, name: str, default: float, use: Use = Use.NUMBER
) -> Texture | float:
    """Return the number of a property, or its texture.

    A colour is replaced by the mean of its three components, as in Mitsuba.

    Raises
    ------
    SceneError
        As `read_texture`.
    """
    texture = _varying(properties, name, use)
    if texture is not None:
        return texture
    return sum(read_color(properties, name, default, use)) / 3.0


def _varying(properties: Properties, name: str, use: Use) -> Texture | None:
    property_ = properties.take(name)
    element = None if property_ is None else property_.value
    if not isinstance(element, Element) or element.plugin not in varying_textures():
        return None  # `read_color` reads and checks constants
    return read_texture_plugin(element, properties.reading, use)


def read_texture_plugin(
    element: Element, reading: Reading, use: Use = Use.REFLECTANCE
) -> Texture:
    """Read a `<texture>` by its plugin; the same element gives the same record each time.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    return reading.once(element, lambda: _read_texture(Properties(element, reading), use))


def _read_texture(properties: Properties, use: Use) -> Texture:
    element = properties.element
    if element.plugin not in varying_textures():
        return ConstantTexture(read_constant_plugin(element, properties.reading))
    check_nesting(element, DEEPEST_TEXTURE)
    texture: Texture = registered_kinds("texture")[element.plugin].read(properties, use)
    properties.finish()
    return texture


# -------------------------------------------------------------------------------- bsdfs
# BSDFs and nested BSDFs.

# Each structure is compiled separately, in time that grows with its depth.
DEEPEST_BSDF = 8


def read_bsdf(element: Element, reading: Reading) -> Bsdf:
    """Read a `<bsdf>`; the same element gives the same record each time.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    return reading.once(element, lambda: _read_bsdf(Properties(element, reading)))


def _read_bsdf(properties: Properties) -> Bsdf:
    plugin = properties.element.plugin
    check_nesting(properties.element, DEEPEST_BSDF)
    bsdf: Bsdf = registered_kinds("bsdf")[plugin].read(properties)
    properties.finish()
    return bsdf


def read_nested(properties: Properties, least: int, most: int, expected: str) -> list[Bsdf]:
    """Return the nested BSDFs of an element, in the order of the file.

    Raises
    ------
    SceneError
        If their number is not from `least` to `most`; the message has `expected`.
    """
    nested = properties.children("bsdf")
    if not least <= len(nested) <= most:
        raise SceneError(
            f"{properties.location}: {properties.element} holds {len(nested)} bsdfs; "
            f"expected {expected}"
        )
    return [read_bsdf(element, properties.reading) for _, element in nested]


# ----------------------------------------------------------------------------- emitters
# Emitters of the scene and of shapes; most of the latter are area lights.
#
# Mitsuba accepts any emitter in a shape. One that is not `area` has the position of its own
# properties and illuminates the scene as if it were outside of the shape; the default BSDF
# of the shape then is black.


def read_radiance(shape: Element, element: Element, reading: Reading) -> Radiance | None:
    """Return the radiance of a shape with a nested emitter; None if it is no area light.

    Raises
    ------
    SceneError
        If it must not be in a shape, or is also in another one.
    """
    owner = reading.owners.setdefault(id(element), shape)
    if owner is not shape:
        raise SceneError(
            f"{shape.location}: {element} of line {element.location.line} is that of the "
            f"shape of line {owner.location.line} already; expected one of its own"
        )
    described = reading.once(element, lambda: _read_emitter(element, reading))
    kind = registered_kinds("emitter")[element.plugin]
    if kind.environment:
        raise SceneError(
            f"{element.location}: {element} cannot be in a shape: it is an environment of "
            "the scene"
        )
    radiance: Radiance | None = described.radiance if kind.on_shapes else None
    return radiance


def read_emitter(element: Element, reading: Reading) -> Emitter | None:
    """Read an `<emitter>` of the scene; None for one that shapes reference.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    described: Emitter = reading.once(element, lambda: _read_emitter(element, reading))
    if not registered_kinds("emitter")[element.plugin].on_shapes:
        return described
    if not element.id:
        raise SceneError(
            f"{element.location}: {element} belongs inside of a <shape>, whose surface "
            "it makes shine, or has an id for shapes to refer to"
        )
    return None


def _read_emitter(element: Element, reading: Reading) -> Any:
    properties = Properties(element, reading)
    described = registered_kinds("emitter")[element.plugin].read(properties)
    weight = properties.number("sampling_weight", 1.0)
    if weight != 1.0:  # it would change the selection of lights
        properties.fail(
            "sampling_weight", f"{weight:g}", "1: lights are chosen with equal probability"
        )
    properties.children("medium")  # ignored for lights, as in Mitsuba
    properties.finish()
    check_place(described, properties)
    return described


# ------------------------------------------------------------------------------- shapes
# Properties of all shapes. The file of each kind reads the others.

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
    # Mitsuba's default BSDF of an area light is black, not grey.
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
    properties.number("silhouette_sampling_weight", 1.0)  # only for derivatives
    media = dict(properties.children("medium"))  # other names are ignored
    inside, outside = media.get("interior"), media.get("exterior")
    common = {
        "bsdf": bsdf,
        "radiance": radiance,
        "interior": None if inside is None else read_medium(inside, reading),
        "exterior": None if outside is None else read_medium(outside, reading),
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
    """Return the surface area as float32, as Mitsuba and the kernels use it."""
    surfaces = kind.surfaces([shape], 0)
    return np.float32(kind.areas(surfaces, np.arange(surfaces.end)).sum())


def placed(properties: Properties, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a product of transforms, after a check that it is usable."""
    if (reason := transforms.why_unusable(matrix)) is not None:
        raise SceneError(
            f"{properties.location}: {properties.element} cannot be placed: {reason}"
        )
    return matrix

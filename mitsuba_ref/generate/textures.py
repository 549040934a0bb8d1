"""How textures are drawn: images, checkerboards, grids, attributes of meshes."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement

from mitsuba_ref.generate import files
from mitsuba_ref.generate.drawing import (
    Drawing,
    Properties,
    Value,
    draw_plugin,
    number_text,
    plain,
)
from mitsuba_ref.generate.values import (
    add_turn,
    choice,
    emission,
    flag,
    number,
    reflectance,
)


def to_uv(drawing: Drawing, name: str) -> list[Element]:
    """Draw a transform of u and v."""
    transform = Element("transform", name=name)
    x, y = (drawing.rng.uniform(-3.0, 4.0) for _ in range(2))
    SubElement(transform, "scale", x=number_text(x or 1.0), y=number_text(y or 1.0))
    if drawing.chance(0.3):
        angle = number_text(drawing.rng.uniform(-180.0, 180.0))
        SubElement(transform, "rotate", z="1", angle=angle)
    if drawing.chance(0.3):
        SubElement(transform, "translate", x=number_text(drawing.rng.uniform(-2.0, 2.0)))
    return [transform]


def image(
    drawing: Drawing, name: str, channels: Sequence[int] = (1, 2, 3, 4)
) -> list[Element]:
    """Draw an image file of one of the formats, with at least that many channels' kinds."""
    rng = drawing.rng
    height, width = rng.randint(1, 6), rng.randint(1, 7)
    kind = rng.choice(("png", "png", "png16", "exr", "half", "pfm"))
    count = rng.choice(channels) if kind.startswith("png") else 3
    pixels = 0.05 + 0.9 * files.numbers_of(rng, height, width, count)
    if kind.startswith("png"):
        content = files.png_bytes(pixels, 16 if kind == "png16" else 8)
    elif kind == "pfm":
        content = files.pfm_bytes(pixels)
    else:
        content = files.exr_bytes(pixels, kind == "half")
    ending = {"png16": "png", "half": "exr"}.get(kind, kind)
    return [plain("string", name, drawing.keep_file(ending, content))]


def light_image(drawing: Drawing, name: str) -> list[Element]:
    """Draw an image of three channels, which shines between its first and last row."""
    rng = drawing.rng
    pixels = files.numbers_of(rng, rng.randint(3, 6), rng.randint(3, 8), 3) + 0.05
    if drawing.chance(0.3):
        pixels[1, 0] = 40.0
    if pixels.max() <= 1.0 or drawing.chance(0.3):
        content, ending = files.png_bytes(pixels.clip(0.0, 1.0), 8), "png"
    else:
        content, ending = files.exr_bytes(pixels, False), "exr"
    return [plain("string", name, drawing.keep_file(ending, content))]


def grid(low: float = 0.05, high: float = 0.95, channels: Sequence[int] = (1, 3)) -> Value:
    """Return what draws a file of a grid of numbers."""

    def draw(drawing: Drawing, name: str) -> list[Element]:
        rng = drawing.rng
        size = [rng.randint(1, 4) for _ in range(3)]
        values = low + (high - low) * files.numbers_of(rng, *size, rng.choice(channels))
        return [plain("string", name, drawing.keep_file("vol", files.grid_bytes(values)))]

    return draw


def box_in_world(drawing: Drawing, name: str) -> list[Element]:
    """Draw where the unit cube of a grid lies: around the middle of the scene."""
    transform = Element("transform", name=name)
    SubElement(transform, "translate", value="-0.5")
    size = drawing.unit * drawing.rng.uniform(1.5, 4.0)
    SubElement(transform, "scale", value=number_text(size))
    add_turn(drawing, transform, 0.4)
    return [transform]


BITMAP: dict[str, Value] = {
    "filename!": image,
    "raw": flag,
    "format": choice("auto", "variant", "fp16"),
    "accel": flag,
    "filter_type": choice("bilinear", "nearest"),
    "wrap_mode": choice("repeat", "mirror", "clamp"),
    "to_uv": to_uv,
}
NORMALS = BITMAP | {
    "filename!": lambda drawing, name: image(drawing, name, (3, 4)),
    "raw!": lambda drawing, name: [plain("boolean", name, "true")],
}
del NORMALS["raw"]
HEIGHTS = NORMALS | {"filename!": image}
LIGHT_BITMAP = BITMAP | {"filename!": light_image}
del LIGHT_BITMAP["format"]

GRID: Properties = {
    "filename!": grid(),
    "filter_type": choice("trilinear", "nearest"),
    "wrap_mode": choice("clamp", "repeat", "mirror"),
    "raw": flag,
    "accel": flag,
    "use_grid_bbox": flag,
    "to_world!": box_in_world,
}


def texture(
    low: float = 0.0,
    high: float = 1.0,
    *,
    plain_share: float = 0.6,
    mean: bool = False,
    as_number: bool = False,
    deep: int = 1,
) -> Value:
    """Return what draws a parameter that may vary over the surface.

    Parameters
    ----------
    low, high
        Range of its numbers; images and grids hold numbers in [0, 1].
    plain_share
        Probability of one colour everywhere.
    mean
        Whether the mean over the surface is needed, which some textures lack.
    as_number
        Whether the parameter is a number, not a colour.
    deep
        How many checkerboards may be inside of one another.
    """

    def draw(drawing: Drawing, name: str) -> list[Element]:
        if drawing.chance(plain_share):
            return [reflectance(drawing, name, low, high, not as_number)]
        possible = ["checkerboard"] if deep else []
        if low <= 0.05 and high >= 0.95:
            possible.append("bitmap")
            if not mean:
                possible.append("volume")
            if drawing.attributes and not mean:
                possible.append("mesh_attribute")
        if not possible:
            return [reflectance(drawing, name, low, high, not as_number)]
        plugin = drawing.pick("texture", possible)
        if plugin == "bitmap":
            return [draw_plugin(drawing, "texture", "bitmap", BITMAP, name)]
        element = Element("texture", type=plugin, name=name)
        if plugin == "volume":
            element.append(volume(drawing, "volume", GRID))
        elif plugin == "mesh_attribute":
            numbers = ("vertex_heat", "face_age")
            colours = () if as_number else ("vertex_color", "face_tint_color")
            element.append(plain("string", "name", drawing.rng.choice(numbers + colours)))
            if drawing.chance(0.4):
                element.append(plain("float", "scale", drawing.rng.uniform(0.2, 1.0)))
        else:
            inner = texture(low, high, mean=mean, as_number=as_number, deep=deep - 1)
            parts = {"color0": inner, "color1": inner, "to_uv": to_uv}
            return [draw_plugin(drawing, "texture", plugin, parts, name)]
        return [element]

    return draw


def volume(drawing: Drawing, name: str, properties: Properties) -> Element:
    """Draw a volume: one number everywhere, or a grid."""
    plugin = drawing.pick("volume", ("constvolume", "gridvolume"))
    if plugin == "gridvolume":
        return draw_plugin(drawing, "volume", plugin, properties, name)
    element = Element("volume", type=plugin, name=name)
    element.append(plain("float", "value", drawing.rng.uniform(0.1, 0.9)))
    return element


def light_texture(most: float, power: int = 0, plain_share: float = 0.7) -> Value:
    """Return what draws the colour of a light that may be a picture."""

    def draw(drawing: Drawing, name: str) -> list[Element]:
        if drawing.chance(plain_share):
            return emission(most, power)(drawing, name)
        plugin = drawing.pick("texture", ("bitmap", "checkerboard"))
        if plugin == "bitmap":
            return [draw_plugin(drawing, "texture", plugin, LIGHT_BITMAP, name)]
        parts = {"color0!": number(0.1, 1.0), "color1!": number(0.0, 1.0), "to_uv": to_uv}
        return [draw_plugin(drawing, "texture", plugin, parts, name)]

    return draw

"""How values are drawn: numbers, colours and transforms."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element, SubElement

from mitsuba_ref.generate.drawing import (
    Drawing,
    Properties,
    Value,
    Vector,
    draw_plugin,
    number_text,
    numbers_text,
    plain,
)

# ------------------------------------------------------------------------ plain values


def number(low: float, high: float, *special: float) -> Value:
    """Return what draws a float of a range, or one of the special ones."""

    def draw(drawing: Drawing, name: str) -> list[Element]:
        x = drawing.rng.uniform(low, high)
        if special and drawing.chance(0.3):
            x = drawing.rng.choice(special)
        return [plain("float", name, x)]

    return draw


def scaled(low: float, high: float, power: int = 1) -> Value:
    """Return what draws a float in units of the scene, to a power of these."""

    def draw(drawing: Drawing, name: str) -> list[Element]:
        size = drawing.unit**power
        return [plain("float", name, size * drawing.rng.uniform(low, high))]

    return draw


def integer(*possible: int) -> Value:
    """Return what draws one of some integers."""

    def draw(drawing: Drawing, name: str) -> list[Element]:
        return [plain("integer", name, str(drawing.rng.choice(possible)))]

    return draw


def choice(*possible: str) -> Value:
    """Return what draws one of some strings."""

    def draw(drawing: Drawing, name: str) -> list[Element]:
        return [plain("string", name, drawing.rng.choice(possible))]

    return draw


def flag(drawing: Drawing, name: str) -> list[Element]:
    """Draw a boolean."""
    return [plain("boolean", name, drawing.rng.choice(("true", "false")))]


def vector(tag: str, reach: float) -> Value:
    """Return what draws a point or vector in units of the scene."""

    def draw(drawing: Drawing, name: str) -> list[Element]:
        return [plain(tag, name, numbers_text(drawing.point(reach)))]

    return draw


def either(*ways: Value) -> Value:
    """Return what draws in one of several ways."""

    def draw(drawing: Drawing, name: str) -> list[Element]:
        return drawing.rng.choice(ways)(drawing, name)

    return draw


def all_of(**properties: Value) -> Value:
    """Return what draws several properties instead of the one that is named."""

    def draw(drawing: Drawing, name: str) -> list[Element]:
        return [e for key, value in properties.items() for e in value(drawing, key)]

    return draw


# ----------------------------------------------------------------------------- colours

SPECTRA: dict[str, Properties] = {
    "regular": {
        "wavelength_min!": number(360, 420),
        "wavelength_max!": number(650, 830),
        "values!": choice("0.2, 0.5, 0.3, 0.8", "0.9, 0.1", "0.4, 0.4, 0.7"),
    },
    "irregular": {
        "wavelengths!": choice("400, 500, 550, 700"),
        "values!": choice("0.1, 0.6, 0.2, 0.5", "0.7, 0.7, 0.1, 0.05"),
    },
}


def reflectance(
    drawing: Drawing, name: str, low: float = 0.0, high: float = 1.0, spectra: bool = True
) -> Element:
    """Draw a colour that is the same everywhere, in one of its forms."""
    form = drawing.rng.randrange(8)
    grey = drawing.rng.choice((low, high, *(drawing.rng.uniform(low, high),) * 6))
    if form < 2 or high > 1.0:
        return plain("float", name, grey)
    if form < 5:
        rgb = [drawing.rng.uniform(low, high) for _ in range(3)]
        return plain("rgb", name, numbers_text(rgb))
    if form == 5:
        return plain("spectrum", name, grey)
    possible = ("uniform", "srgb", "rawconstant", *(SPECTRA if spectra else ()))
    plugin = drawing.pick("texture", possible)
    if plugin in SPECTRA:
        return draw_plugin(drawing, "spectrum", plugin, SPECTRA[plugin], name)
    element = Element("texture", type=plugin, name=name)
    if plugin in ("uniform", "rawconstant"):
        element.append(plain("float", "value", grey))
    else:
        rgb = [drawing.rng.uniform(low, high) for _ in range(3)]
        element.append(plain("rgb", "color", numbers_text(rgb)))
    return element


def emission(most: float, power: int = 0) -> Value:
    """Return what draws the colour of a light, in units of the scene to a power."""

    def draw(drawing: Drawing, name: str) -> list[Element]:
        size = most * drawing.unit**power
        rgb = [size * drawing.rng.uniform(0.1, 1.0) for _ in range(3)]
        form = drawing.rng.randrange(6)
        if form == 0:
            return [plain("float", name, rgb[0])]
        if form == 1:
            return [plain("spectrum", name, rgb[0])]
        if form == 2 and drawing.pick("texture", ("d65", "blackbody")) == "d65":
            light = Element("spectrum", type="d65", name=name)
            light.append(plain("float", "scale", rgb[0]))
            return [light]
        if form == 2:
            light = Element("spectrum", type="blackbody", name=name)
            light.append(plain("float", "temperature", drawing.rng.uniform(1500.0, 7000.0)))
            return [light]
        return [plain("rgb", name, numbers_text(rgb))]

    return draw


# -------------------------------------------------------------------------- transforms


def add_turn(drawing: Drawing, transform: Element, share: float) -> None:
    """Add a rotation about an axis of length 1, which six digits can hold."""
    if drawing.chance(share):
        axis = drawing.rng.choice(("1, 0, 0", "0, 1, 0", "0, 0, 1", "0.6, 0, -0.8"))
        angle = drawing.rng.choice((90.0, 180.0, *(drawing.rng.uniform(-180, 180),) * 6))
        SubElement(transform, "rotate", value=axis, angle=number_text(angle))


def placed(kind: str, size: tuple[float, float] = (0.3, 0.9)) -> Value:
    """Return what draws `to_world` of a shape.

    Parameters
    ----------
    kind
        "rigid": turned, of one scale, perhaps mirrored; "turned": without mirroring;
        "moved": a scale for each axis, not turned; "affine": anything.
    size
        Of what is drawn, in units of the scene.
    """

    def draw(drawing: Drawing, name: str) -> list[Element]:
        rng, transform = drawing.rng, Element("transform", name=name)
        scales = [drawing.unit * rng.uniform(*size) for _ in range(3)]
        if kind in ("rigid", "turned"):
            scales = scales[:1] * 3
        if kind in ("rigid", "affine") and drawing.chance(0.2):
            scales[0] = -scales[0]
        SubElement(transform, "scale", value=numbers_text(scales))
        if kind == "affine" and drawing.chance(0.15):
            a, b = (rng.uniform(-0.6, 0.6) for _ in range(2))
            rows = [1, a, 0, 0, 0, 1, 0, 0, b, 0, 1, 0, 0, 0, 0, 1]
            text = " ".join(map(number_text, rows))
            SubElement(transform, "matrix", value=text)
        if kind != "moved":
            add_turn(drawing, transform, 0.7)
        SubElement(transform, "translate", value=numbers_text(drawing.point(1.2)))
        return [transform]

    return draw


def turned(drawing: Drawing, name: str) -> list[Element]:
    """Draw a rotation, of something far away."""
    transform = Element("transform", name=name)
    add_turn(drawing, transform, 1.0)
    add_turn(drawing, transform, 0.5)
    return [transform]


def look_at(
    drawing: Drawing, name: str, distance: tuple[float, float], scale: float = 0.0
) -> Element:
    """Return a transform from where one sees the middle of the scene."""
    transform = Element("transform", name=name)
    if scale:
        SubElement(transform, "scale", value=number_text(drawing.unit * scale))
    x, y, z = drawing.direction()
    away = drawing.unit * drawing.rng.uniform(*distance)
    origin = away * x, away * (abs(y) + 0.2), away * z
    up = "0, 1, 0" if math.hypot(x, z) > 0.3 else "0, 0, 1"
    target = numbers_text(drawing.point(0.3))
    SubElement(transform, "lookat", origin=numbers_text(origin), target=target, up=up)
    return transform


def aimed(drawing: Drawing, name: str) -> list[Element]:
    """Draw where a light stands that looks at the middle of the scene."""
    return [look_at(drawing, name, (3.0, 5.0))]


def above(drawing: Drawing, tag: str, name: str, distance: float) -> Element:
    """Return a point over the scene."""
    x, y, z = drawing.direction()
    place: Vector = x, abs(y) + 0.3, z
    return plain(tag, name, numbers_text([drawing.unit * distance * c for c in place]))

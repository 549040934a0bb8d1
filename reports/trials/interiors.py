"""Rooms with the materials of rooms: a kitchen, a conservatory, a gallery.

Bitmaps, varnish, rough metals, glass, leaves that are masks, bumps; lit by an environment
map through windows, and by lamps behind panes of glass.
"""

# ruff: noqa: RUF005  an array plus a tuple is a sum, not a longer tuple

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from reports.trials.architecture_model import Floats, Model, grid, image, reflectance
from reports.trials.meshes import displaced_icosphere

RAW = '<boolean name="raw" value="true"/>'
GLASS = '<bsdf type="dielectric"/>'
FROSTED = '<bsdf type="roughdielectric"><float name="alpha" value="0.2"/></bsdf>'
PANE = '<bsdf type="thindielectric"/>'


def varnished(colour: str, alpha: float) -> str:
    """Return the <bsdf> of a rough coat over a colour or texture."""
    inside = reflectance("diffuse_reflectance", colour)
    rough = f'<float name="alpha" value="{alpha}"/>'
    return f'<bsdf type="twosided"><bsdf type="roughplastic">{rough}{inside}</bsdf></bsdf>'


def metal(name: str, alpha: float) -> str:
    """Return the <bsdf> of a rough metal."""
    inside = f'<string name="material" value="{name}"/>'
    rough = f'<float name="alpha" value="{alpha}"/>'
    return (
        f'<bsdf type="twosided"><bsdf type="roughconductor">{inside}{rough}</bsdf></bsdf>'
    )


def bumpy(bsdf: str, scale: float) -> str:
    """Return a <bsdf> whose surface is uneven."""
    return f'<bsdf type="bumpmap">{image("arbitrary", "bumps", RAW)}' + (
        f'<float name="scale" value="{scale}"/>{bsdf}</bsdf>'
    )


def holed(opacity: str, bsdf: str) -> str:
    """Return a <bsdf> with holes where a texture is black."""
    return f'<bsdf type="mask">{image("opacity", opacity, RAW)}{bsdf}</bsdf>'


def kitchen() -> Model:
    """Return a kitchen lit by the sky through a window, and by lamps over its table."""
    model = Model(
        (-1.9, -2.6, 1.65),
        (0.7, 2.4, 0.95),
        72.0,
        {
            "floor": bumpy(varnished("tiles", 0.2), 0.02),
            "wall": bumpy(varnished("plaster", 0.4), 0.01),
            "front": varnished("0.7, 0.72, 0.66", 0.12),
            "worktop": varnished("marble", 0.08),
            "wood": varnished("planks", 0.25),
            "steel": metal("Al", 0.12),
            "copper": metal("Cu", 0.2),
            "ceramic": varnished("0.75, 0.7, 0.62", 0.06),
            "jar": GLASS,
            "window": PANE,
        },
        sky="image",
        depth=8,
        smooth=True,
    )
    model.boxes("floor", (-3, -3, -0.2), (3, 3, 0), 2.0)
    low: list[Any] = [(-3.2, -3, 0), (3, -3, 0), (-3, -3.2, 0), (-3, -3, 2.7)]
    high: list[Any] = [(-3, 3, 2.7), (3.2, 3, 2.7), (3, -3, 2.7), (3, 3, 2.9)]
    # the wall with the window: what is left, right, below and above of it
    low += [(-3, 3, 0), (1.5, 3, 0), (-1.5, 3, 0), (-1.5, 3, 2.25)]
    high += [(-1.5, 3.2, 2.7), (3, 3.2, 2.7), (1.5, 3.2, 1.15), (1.5, 3.2, 2.7)]
    model.boxes("wall", low, high, 2.5)
    pane = [(-0.5, 3.1, 1.15), (1.5, 3.1, 1.15), (1.5, 3.1, 2.25), (-0.5, 3.1, 2.25)]
    model.sheets("window", [pane])  # the sash on the left is open
    for x in (-1.5, -0.52, 0.48, 1.46):
        model.boxes("wood", (x - 0.02, 3.05, 1.15), (x + 0.06, 3.15, 2.25))
    doors = grid(np.arange(-2.95, 2.9, 0.6), 2.4, 0.1)
    model.boxes("front", doors, doors + (0.58, 0.58, 0.76))
    model.boxes("front", doors + (0.06, -0.015, 0.06), doors + (0.52, 0, 0.7))
    handle = [(0.0, 0), (0.012, 0.005), (0.008, 0.06), (0.012, 0.115), (0.0, 0.12)]
    model.lathe("steel", handle, doors + (0.5, -0.04, 0.5), 24, rings=24)
    model.boxes("worktop", (-3, 2.3, 0.88), (3, 3, 0.93), 1.5)
    shelves = grid(-3.0, -2.0, (1.3, 1.75, 2.2))
    model.boxes("wood", shelves, shelves + (0.35, 3.6, 0.03), 0.7)
    jars = grid(-2.83, np.arange(-1.85, 1.5, 0.22), (1.33, 1.78))
    model.lathe("jar", _vessel(0.08, 0.24, 0.006), jars, 40, rings=40)
    plates = grid((-2.4, -0.6, 2.0), (2.62, 2.82), 0.93)
    stack = (plates[:, None] + grid(0, 0, 0.012 * np.arange(6))).reshape(-1, 3)
    plate = [(0, 0), (0.07, 0), (0.12, 0.016), (0.12, 0.019), (0.07, 0.005), (0, 0.005)]
    model.lathe("ceramic", plate, stack, 48, rings=16)
    pots = grid((-1.9, -1.45, 0.2, 0.7), 2.65, 0.93)
    model.lathe("steel", _vessel(0.14, 0.2, 0.004), pots, 64, rings=48)
    hung = grid(-2.8, np.arange(-1.7, 1.5, 0.35), 2.24)
    model.lathe("copper", _vessel(0.12, 0.12, 0.003), hung, 64, rings=48)
    model.boxes("wood", (0.0, -0.9, 0.72), (2.0, 0.5, 0.76), 1.0)
    leg = [(0.05, 0), (0.03, 0.1), (0.045, 0.4), (0.03, 0.6), (0.05, 0.72)]
    model.lathe("wood", leg, grid((0.1, 1.9), (-0.8, 0.4), 0.0), 32, rings=40)
    cups = grid(np.linspace(0.2, 1.8, 6), np.linspace(-0.75, 0.35, 4), 0.76)
    model.lathe("ceramic", _vessel(0.045, 0.09, 0.003), cups[::2], 40, rings=32)
    model.lathe("jar", _vessel(0.035, 0.13, 0.003), cups[1::2], 40, rings=32)
    shades = grid((0.4, 1.0, 1.6), -0.2, 1.75)
    model.lathe("copper", [(0.16, 0), (0.14, 0.06), (0.03, 0.16), (0.01, 0.95)], shades, 48)
    model.lamp(shades + (0, 0, 0.02), (0.0, 0.0, -1.0), (0.07, 0.07), "60, 48, 32")
    return model


def _vessel(radius: float, height: float, wall: float) -> list[tuple[float, float]]:
    """Return the closed outline of a cup: up outside, down inside."""
    r, h, w = radius, height, wall
    outside = [(0.0, 0.0), (0.85 * r, 0.0), (r, 0.3 * h), (r, 0.8 * h), (0.9 * r, h)]
    inside = [(0.9 * r - w, h), (r - w, 0.8 * h), (r - w, 0.3 * h), (0.85 * r - w, w)]
    return [*outside, *inside, (0.0, w)]


def conservatory() -> Model:
    """Return a glass house full of leaves under the sky."""
    model = Model(
        (0.2, -5.2, 1.6),
        (-0.2, 4.0, 1.7),
        74.0,
        {
            "floor": bumpy(varnished("paving", 0.3), 0.03),
            "rib": metal("Al", 0.25),
            "pot": varnished("brick", 0.3),
            "soil": "0.1, 0.07, 0.05",
            "stem": "0.2, 0.22, 0.08",
            "leaf": holed(
                "leaf",
                '<bsdf type="twosided"><bsdf type="diffuse">'
                f"{image('reflectance', 'foliage')}</bsdf></bsdf>",
            ),
            "bench": varnished("planks", 0.2),
            "pane": PANE,
        },
        sky="image",
        depth=8,
        smooth=True,
    )
    rng = np.random.default_rng(19)
    model.boxes("floor", (-4, -6, -0.2), (4, 6, 0), 1.5)
    y = np.linspace(-6.0, 6.0, 13)
    panes = []
    for a, b in itertools.pairwise(y.tolist()):
        for sign in (-1.0, 1.0):
            for z in (0.0, 1.25):
                panes.append(_wall((sign * 4, a, z), (sign * 4, b, z), 1.25))
            panes.append([(sign * 4, a, 2.5), (sign * 4, b, 2.5), (0, b, 4.2), (0, a, 4.2)])
    for end in (-6.0, 6.0):
        panes += [_wall((x, end, 0), (x + 2, end, 0), 2.5) for x in (-4, -2, 0, 2)]
        panes.append([(-4, end, 2.5), (4, end, 2.5), (0, end, 4.2), (0, end, 4.2)])
    model.sheets("pane", panes)
    for sign in (-1.0, 1.0):
        for x, z in ((4.0, 0.0), (4.0, 1.25), (4.0, 2.5), (2.0, 3.35), (0.0, 4.2)):
            model.boxes("rib", (sign * x - 0.03, -6, z), (sign * x + 0.03, 6, z + 0.06))
        model.lathe("rib", [(0.03, 0), (0.03, 2.5)], grid(sign * 4.0, y, 0), 16, rings=20)
        steps = np.linspace(0, 1, 24)
        slope = np.stack((sign * 4 * (1 - steps), 0 * steps, 2.5 + 1.7 * steps), axis=1)
        model.boxes(
            "rib",
            (slope[:, None] + grid(0, y, 0) - (0.09, 0.02, 0.03)).reshape(-1, 3),
            (slope[:, None] + grid(0, y, 0) + (0.09, 0.02, 0.04)).reshape(-1, 3),
        )
    pots = np.concatenate(
        (
            grid((-3.2, 3.2), np.arange(-5.2, 5.5, 0.9), 0.0),
            grid((-1.9, 1.9), np.arange(-3.6, 5.5, 1.8), 0.0),
        )
    )
    model.lathe("pot", _vessel(0.26, 0.42, 0.03), pots, 40, rings=24)
    model.lathe("soil", [(0.22, 0.37), (0.0, 0.38)], pots, 24)
    for pot in pots:
        _plant(model, pot + (0, 0, 0.38), rng)
    model.boxes("bench", (-0.5, 2.6, 0.4), (0.5, 3.6, 0.46), 0.6)
    model.boxes(
        "rib", grid((-0.45, 0.4), (2.65, 3.5), 0), grid((-0.4, 0.45), (2.7, 3.55), 0.4)
    )
    return model


def _wall(a: Sequence[float], b: Sequence[float], height: float) -> list[Sequence[float]]:
    """Return an upright pane over the line from a to b."""
    up = np.array([0, 0, height])
    return [a, b, tuple(b + up), tuple(a + up)]


def _plant(model: Model, root: Floats, rng: np.random.Generator) -> None:
    """Add a plant of some stems with bent leaves."""
    tall = rng.uniform(0.7, 1.6)
    model.lathe("stem", [(0.02, 0), (0.012, tall)], root, 12, rings=12)
    leaves, parts = 130, 6
    azimuth = rng.uniform(0, 2 * np.pi, leaves)
    height = tall * rng.uniform(0.15, 1.0, leaves)
    long, wide = rng.uniform(0.25, 0.55, leaves), rng.uniform(0.07, 0.15, leaves)
    out = np.stack((np.cos(azimuth), np.sin(azimuth), 0 * azimuth), axis=1)
    side = np.stack((-np.sin(azimuth), np.cos(azimuth), 0 * azimuth), axis=1)
    s = np.linspace(0.0, 1.0, parts + 1)
    rise = 0.5 * s - 0.75 * s**2  # up, then down
    spine = long[:, None, None] * (
        out[:, None] * s[:, None] + np.array([0, 0, 1]) * rise[:, None]
    )
    spine = spine + root + np.array([0, 0, 1]) * height[:, None, None]
    edge = 0.5 * (side * wide[:, None])[:, None]
    vertices = np.stack((spine - edge, spine + edge), axis=2)  # (leaves, parts + 1, 2, 3)
    uv = np.stack(np.meshgrid([0.0, 1.0], s, indexing="xy"), axis=-1)
    uv = np.broadcast_to(uv, (leaves, parts + 1, 2, 2))
    first = 2 * np.arange(parts) + 2 * (parts + 1) * np.arange(leaves)[:, None]
    quads = np.stack((first, first + 1, first + 3, first + 2), axis=-1).reshape(-1, 4)
    model.add("leaf", vertices.reshape(-1, 3), quads, uv.reshape(-1, 2))


def gallery() -> Model:
    """Return a hall of sculptures under lamps that are behind panes of glass."""
    model = Model(
        (-3.6, -8.6, 1.75),
        (1.4, 6.0, 1.3),
        70.0,
        {
            "floor": varnished("planks", 0.1),
            "wall": bumpy(varnished("plaster", 0.35), 0.015),
            "frame": metal("Au", 0.25),
            "picture1": varnished("brick", 0.2),
            "picture2": varnished("foliage", 0.2),
            "picture3": varnished("marble", 0.2),
            "plinth": varnished("0.6, 0.6, 0.62", 0.15),
            "gold": metal("Au", 0.12),
            "bronze": metal("Cu", 0.3),
            "glazed": varnished("0.1, 0.25, 0.45", 0.05),
            "frosted": FROSTED,
            "crystal": GLASS,
            "glass": GLASS,
        },
        depth=8,
        smooth=True,
    )
    model.boxes("floor", (-5, -9, -0.2), (5, 9, 0), 1.6)
    low: list[Any] = [(-5.2, -9, 0), (-5, 9, 0), (-5, -9.2, 0), (-5, -9, 4.2)]
    high: list[Any] = [(-5, 9, 4.2), (5, 9.2, 4.2), (5, -9, 4.2), (5, 9, 4.4)]
    # the wall with the windows: below, above and between them
    low += [(5, -9, 0), (5, -9, 3.4), *grid(5.0, np.arange(-9.0, 9, 3.0), 1.2)]
    high += [(5.2, 9, 1.2), (5.2, 9, 4.2), *grid(5.2, np.arange(-9.0, 9, 3.0) + 1.4, 3.4)]
    model.boxes("wall", low, high, 2.5)
    windows = np.arange(-7.6, 9, 3.0)
    model.boxes("glass", grid(5.05, windows, 1.2), grid(5.06, windows + 1.6, 3.4))
    model.lamp(grid(5.6, windows + 0.8, 2.3), (-1.0, 0.0, 0.0), (1.1, 1.3), "5, 6, 7.5")
    lamps = grid(np.linspace(-4, 4, 4), np.linspace(-8, 8, 8), 4.15)
    model.lamp(lamps, (0.0, 0.0, -1.0), (0.12, 0.12), "55, 45, 32")
    covered = lamps[::2]
    model.boxes("glass", covered - (0.2, 0.2, 0.08), covered + (0.2, 0.2, -0.07))
    for number, place in enumerate(grid(-4.98, np.arange(-7.5, 8, 2.5), 1.3)):
        model.boxes("frame", place - (0, 0.1, 0.1), place + (0.04, 1.5, 1.2))
        corner = place + (0.05, 0, 0)
        across, up = np.array([0, 1.4, 0]), np.array([0, 0, 1.1])
        model.sheets(
            f"picture{number % 3 + 1}",
            [[corner, corner + across, corner + across + up, corner + up]],
        )
    plinths = grid((-2.6, 0.0, 2.6), np.arange(-6.0, 8, 2.2), 0.0)
    model.boxes("plinth", plinths - (0.3, 0.3, 0), plinths + (0.3, 0.3, 0.9))
    ball = displaced_icosphere(32)
    vertices = np.asarray(ball.vertices, np.float64)
    faces = np.asarray(ball.faces, np.int64)
    uv = np.arctan2(vertices[:, 1], vertices[:, 0]) / (2 * np.pi) + 0.5
    uv = np.stack((uv, vertices[:, 2] / 2 + 0.5), axis=1)
    kinds = ("gold", "glazed", "bronze", "crystal", "frosted")
    for number, plinth in enumerate(plinths):
        stretch = 0.3 * np.array([1.0, 1.0, 1.0 + 0.5 * (number % 3)])
        place = plinth + (0, 0, 0.9 + 1.25 * stretch[2])
        model.add(kinds[number % len(kinds)], vertices * stretch + place, faces, uv)
    model.boxes("plinth", (-0.4, -8.0, 0.4), (0.4, -7.0, 0.46))
    return model


INTERIORS: dict[str, Callable[[], Model]] = {
    "kitchen": kitchen,
    "conservatory": conservatory,
    "gallery": gallery,
}

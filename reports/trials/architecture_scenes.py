"""Scenes of architecture size: a columned hall, a street at night, a library.

Each has 100,000 to 2,000,000 triangles, textures and dozens to hundreds of lamps, and is
written to the cache when it is measured first. All surfaces of these three are diffuse on
both sides, so that programs with other material models can draw them too; those of
`interiors` have the materials of rooms.
"""

# ruff: noqa: RUF005  an array plus a tuple is a sum, not a longer tuple

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from renderer.process.cache_folder import cache_folder
from reports.trials import architecture_model, interiors
from reports.trials.architecture_model import Floats, Model, grid

VIEWS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def hall() -> Model:
    """Return a hall of two rows of fluted columns under a coffered ceiling."""
    model = Model(**VIEWS["hall"])
    model.boxes("marble", (-8, -2, -0.2), (8, 40, 0), 2.0)
    low = [(-8.4, -2, 0), (8, -2, 0), (-8, 40, 0), (-8, -2.4, 0)]
    high = [(-8, 40, 9), (8.4, 40, 9), (8, 40.4, 9), (8, -2, 9)]
    model.boxes("wall", low, high, 3.0)
    columns = grid((-4.2, 4.2), np.arange(0.5, 39.0, 3.5), 0.4)
    shaft = [(0.62, 0), (0.5, 0.12), (0.52, 0.3), (0.46, 3), (0.4, 6), (0.4, 6.1)]
    model.lathe("stone", shaft, columns, 144, 24, 40)
    model.boxes("stone", columns - (0.7, 0.7, 0.4), columns + (0.7, 0.7, 0))
    capital = [(0.42, 6.1), (0.55, 6.2), (0.5, 6.3), (0.72, 6.6), (0.72, 6.7)]
    model.lathe("gold", capital, columns, 48, 12, 12)
    model.boxes("stone", grid((-4.95, 3.45), -2, 7.1), grid((-3.45, 4.95), 40, 7.9))
    x, y = np.arange(-8, 8, 1.6), np.arange(-2, 40, 1.75)
    for step in range(5):  # frames that step up into each coffer
        edge, z = 0.14 + 0.1 * step, 9.0 + 0.12 * step
        for side in range(2):
            corner, opposite = grid(x, y, z), grid(x + 1.6, y + 1.75, z + 0.12)
            first, last = opposite.copy(), corner.copy()
            first[:, side] = corner[:, side] + edge
            last[:, side] = opposite[:, side] - edge
            model.boxes("stone", corner, first)
            model.boxes("stone", last, opposite)
    model.boxes("gold", (-8, -2, 9.6), (8, 40, 9.7))
    for sign in (-1.0, 1.0):  # windows high in the walls
        places = grid(sign * 7.95, np.arange(1.5, 39.0, 3.5), 6.2)
        model.lamp(places, (-sign, 0.0, 0.0), (0.6, 1.6), "9, 10, 12")
    lanterns = grid((-2.0, 2.0), np.arange(2.25, 39.0, 3.5), 5.6)
    model.lamp(lanterns, (0.0, 0.0, -1.0), (0.2, 0.2), "60, 42, 22")
    model.lathe(
        "gold",
        [(0.3, 0.05), (0.34, 0.2), (0.1, 0.5), (0.02, 0.7), (0.02, 3.4)],
        lanterns,
        32,
    )
    return model


def street() -> Model:
    """Return a street of houses at night, with lit windows and street lamps."""
    model = Model(**VIEWS["street"])
    rng = np.random.default_rng(7)
    model.boxes("paving", (-30, -20, -0.2), (30, 90, 0), 1.5)
    for sign in (-1.0, 1.0):
        low, high = sorted((sign * 4.2, sign * 7.0))
        model.boxes("plaster", (low, -20, 0), (high, 90, 0.15), 1.5)  # pavement
        for house in range(12):
            y, floors = -16.0 + 8.0 * house, int(rng.integers(3, 6))
            low, high = sorted((sign * 7.0, sign * 17.0))
            top = 1.0 + 3.2 * floors
            wall = ("brick", "plaster")[house % 2]
            model.boxes(wall, (low, y, 0), (high, y + 8, top), 1.0)
            low, high = sorted((sign * 6.6, sign * 7.0))
            for z in (1.0, top - 0.3, top):  # cornices
                model.boxes("frame", (low + 0.1, y, z - 0.2), (high, y + 8, z))
            windows = grid(
                sign * 7.0,
                y + np.array([1.2, 3.1, 5.0, 6.9]),
                1.7 + 3.2 * np.arange(floors),
            )
            _windows(model, windows, sign, rng)
            model.boxes(
                "iron",
                windows[::2] + (-0.6, -0.75, -0.75),
                windows[::2] + (0.6, 0.75, -0.68),
            )
            rails = grid(sign * 6.45, np.linspace(-0.7, 0.7, 9), 0.0)
            baluster = [
                (0.015, -0.7),
                (0.03, -0.5),
                (0.015, -0.3),
                (0.035, -0.1),
                (0.015, 0.15),
            ]
            ends = windows[::2] * (0, 1, 1)
            model.lathe(
                "iron", baluster, (ends[:, None] + rails).reshape(-1, 3), 16, rings=14
            )
            model.boxes(
                "iron",
                ends + (sign * 6.45 - 0.03, -0.75, 0.15),
                ends + (sign * 6.45 + 0.03, 0.75, 0.2),
            )
        posts = grid(sign * 4.7, np.arange(-12.0, 90.0, 9.0), 0.15)
        model.lathe(
            "iron",
            [(0.16, 0), (0.1, 0.4), (0.06, 1), (0.05, 4), (0.2, 4.1), (0.05, 4.5)],
            posts,
            24,
            rings=30,
        )
        model.lamp(posts + (0, 0, 4.05), (0.0, 0.0, -1.0), (0.16, 0.16), "260, 170, 80")
    return model


def _windows(model: Model, places: Floats, sign: float, rng: np.random.Generator) -> None:
    """Add panes, lit or dark, with frames and sills; a place is the middle."""
    lit = rng.random(len(places)) < 0.4
    model.lamp(
        places[lit] - (0.02 * sign, 0, 0), (-sign, 0.0, 0.0), (0.5, 0.7), "3, 2.1, 1.1"
    )
    dark = places[~lit]
    model.boxes("glass", dark - (0.02, 0.5, 0.7), dark + (0.02, 0.5, 0.7))
    for y in (-0.55, 0.0, 0.5):
        model.boxes("frame", places + (-0.12, y, -0.7), places + (0.12, y + 0.05, 0.7))
    for z in (-0.75, -0.2, 0.25, 0.7):
        model.boxes("frame", places + (-0.12, -0.55, z), places + (0.12, 0.55, z + 0.05))
    model.boxes("frame", places + (-0.3, -0.65, -0.85), places + (0.3, 0.65, -0.75))


def library() -> Model:
    """Return a reading room: shelves of books, tables, chairs and hundreds of lamps."""
    model = Model(**VIEWS["library"])
    books = [name for name in model.colours if name.startswith("book")]
    rng = np.random.default_rng(11)
    model.boxes("wood", (-7, -1, -0.1), (7, 30, 0), 1.2)
    walls = [(-7.2, -1, 0), (7, -1, 0), (-7, 30, 0), (-7, -1.2, 0), (-7, -1, 5)]
    ends = [(-7, 30, 5), (7.2, 30, 5), (7, 30.2, 5), (7, -1, 5), (7, 30, 5.2)]
    model.boxes("wall", walls, ends, 3.0)
    heights = 0.1 + 0.42 * np.arange(9)
    for sign in (-1.0, 1.0):
        low, high = sorted((sign * 6.6, sign * 7.0))
        model.boxes(
            "dark",
            grid(low, np.arange(0, 29.1, 1.45), 0),
            grid(high, np.arange(0.06, 29.2, 1.45), 4.0),
        )
        model.boxes("dark", grid(low, 0, heights - 0.04), grid(high, 29.06, heights))
        for z in heights[:-1]:
            edges = np.cumsum(rng.uniform(0.025, 0.065, 650))
            edges = edges[(edges < 28.9) & (np.mod(edges, 1.45) > 0.13)]
            widths = rng.uniform(0.018, 0.024, len(edges))
            tall = rng.uniform(0.22, 0.36, len(edges))
            deep = rng.uniform(0.02, 0.12, len(edges))
            near = np.where(sign < 0, low, low + deep)
            far = np.where(sign < 0, high - deep, high)
            colours = rng.integers(0, len(books), len(edges))
            for k, book in enumerate(books):
                at = colours == k
                first = np.stack((near, edges, np.full_like(edges, z)), axis=1)[at]
                last = np.stack((far, edges + widths, z + tall), axis=1)[at]
                model.boxes(book, first, last)
    tables = grid((-2.6, 2.6), np.arange(2.0, 29.0, 3.0), 0.0)
    model.boxes("wood", tables + (-1.5, -0.5, 0.74), tables + (1.5, 0.5, 0.8), 0.8)
    leg = [(0.04, 0), (0.06, 0.1), (0.03, 0.2), (0.06, 0.45), (0.035, 0.6), (0.07, 0.74)]
    legs = (tables[:, None] + grid((-1.35, 1.35), (-0.4, 0.4), 0.0)).reshape(-1, 3)
    model.lathe("dark", leg, legs, 32, rings=40)
    chairs = (tables[:, None] + grid((-0.9, 0.0, 0.9), (-0.85, 0.85), 0.0)).reshape(-1, 3)
    model.boxes("dark", chairs + (-0.22, -0.22, 0.42), chairs + (0.22, 0.22, 0.47))
    feet = (chairs[:, None] + grid((-0.18, 0.18), (-0.18, 0.18), 0.0)).reshape(-1, 3)
    model.lathe(
        "dark", [(0.02, 0), (0.03, 0.15), (0.018, 0.25), (0.028, 0.42)], feet, 20, rings=24
    )
    model.boxes("dark", chairs + (-0.22, 0.18, 0.5), chairs + (0.22, 0.22, 0.95))
    lamps = (tables[:, None] + grid((-0.9, 0.0, 0.9), 0.0, 1.2)).reshape(-1, 3)
    pendants = grid(np.linspace(-5.6, 5.6, 8), np.arange(0.8, 29.5, 1.5), 3.7)
    shade = [(0.16, -0.06), (0.14, 0.0), (0.04, 0.1), (0.01, 0.12)]
    model.lathe("brass", shade, np.concatenate((lamps, pendants)), 32, rings=12)
    model.lathe("brass", [(0.08, -0.4), (0.012, -0.38), (0.012, 0.1)], lamps, 16)
    model.lathe("dark", [(0.008, 0.1), (0.008, 1.3)], pendants, 8)
    model.lamp(
        np.concatenate((lamps, pendants)) - (0, 0, 0.03),
        (0.0, 0.0, -1.0),
        (0.08, 0.08),
        "46, 34, 20",
    )
    return model


ARCHITECTURE: dict[str, Callable[[], Model]] = {
    "hall": hall,
    "street": street,
    "library": library,
    **interiors.INTERIORS,
}


def architecture_scene(name: str) -> Path:
    """Return the scene file of one of `ARCHITECTURE`; write it to the cache if it lacks."""
    modules = (__file__, architecture_model.__file__, interiors.__file__)
    sources = (*map(Path, modules), Path(__file__).with_suffix(".toml"))
    content = b"".join(source.read_bytes() for source in sources)
    digest = hashlib.sha256(content).hexdigest()[:12]
    folder = cache_folder("architecture_scenes") / digest / name
    path = folder / "scene.xml"
    if not path.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        ARCHITECTURE[name]().write(path)
    return path

"""Figures of the lessons in docs/notebooks: scenes that can be turned, pictures in a row.

A figure is made of traces: `figure(*surfaces(scene), rays(...), boxes(...))`. World
coordinates are kept; the y axis points up.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import plotly.express as px
import plotly.graph_objects as go
from numpy.typing import ArrayLike, NDArray

from renderer.plugins.sensors.pinhole import pinhole
from renderer.rendering.picture.picture import srgb_from_linear
from renderer.scene_file.description import Mesh, PerspectiveCamera, Rectangle
from renderer.simple.scene import Scene
from renderer.simple.shapes import Surface

GREY, LAMP, RAY, BOX = "#9aa0a6", "#f2b705", "#3f7fc4", "#b8478a"
WIDTH = 900  # [pixels] of a notebook, about
ROUND = 24  # steps around a sphere, a disk or a cylinder
# corners of a box are numbered by bits: 1 for the upper end in x, 2 in y, 4 in z
EDGES = [(a, a | bit) for bit in (1, 2, 4) for a in range(8) if not a & bit]


def figure(*traces: Any, title: str = "", height: int = 480) -> go.Figure:
    """Return a figure of traces, with one scale on all axes and y upwards."""
    view = {
        "aspectmode": "data",
        "camera": {"up": {"x": 0, "y": 1, "z": 0}, "eye": {"x": 1.3, "y": 0.9, "z": 1.7}},
    }
    margin = {"l": 0, "r": 0, "t": 40 if title else 0, "b": 0}
    layout = {"scene": view, "margin": margin, "height": height, "title": title}
    return go.Figure(list(traces), layout)


def surfaces(scene: Scene, opacity: float = 0.35) -> list[go.Mesh3d]:
    """Return one trace for each surface of a readable scene; lamps are yellow."""
    return [
        _mesh(surface, f"surface {number}", opacity)
        for number, surface in enumerate(scene.surfaces)
    ]


def _mesh(surface: Surface, name: str, opacity: float) -> go.Mesh3d:
    """Return a surface as triangles."""
    if isinstance(surface.shape, Mesh):
        points, faces = surface.shape.vertices, surface.shape.faces
    else:
        steps = 2 if isinstance(surface.shape, Rectangle) else ROUND + 1
        u, v = np.meshgrid(*2 * [np.linspace(0.0, 1.0, steps)], indexing="ij")
        unit = [surface.unit.point(*place) for place in zip(u.flat, v.flat, strict=True)]
        points = np.array(unit) @ surface.A[0].T + surface.a[0]
        a = np.add.outer(np.arange(steps - 1) * steps, np.arange(steps - 1)).ravel()
        halves = ([a, a + 1, a + steps], [a + 1, a + steps + 1, a + steps])
        faces = np.hstack(halves).T
    colour = LAMP if surface.radiance is not None else GREY
    x, y, z = np.asarray(points, float).T
    i, j, k = np.asarray(faces).T
    return go.Mesh3d(
        x=x, y=y, z=z, i=i, j=j, k=k, name=name, color=colour, opacity=opacity,
        flatshading=True, hoverinfo="name",
    )  # fmt: skip


def paths(
    lines: Iterable[ArrayLike], name: str = "", colour: str = RAY, width: float = 3.0
) -> go.Scatter3d:
    """Return polylines, each an array of shape (n, 3), as one trace."""
    gap = np.full((1, 3), np.nan)
    parts = [part for line in lines for part in (np.reshape(line, (-1, 3)), gap)]
    x, y, z = np.concatenate(parts or [gap]).astype(float).T
    style = {"color": colour, "width": width}
    return go.Scatter3d(
        x=x, y=y, z=z, mode="lines", line=style, name=name, hoverinfo="name"
    )


def rays(
    origins: ArrayLike, ends: ArrayLike, name: str = "", colour: str = RAY
) -> go.Scatter3d:
    """Return segments from origins to ends, both (n, 3), as one trace."""
    pairs = np.stack(np.broadcast_arrays(origins, ends), axis=1)
    return paths(pairs, name, colour)


def points(
    places: ArrayLike, name: str = "", colours: str | Sequence[Any] | NDArray[Any] = RAY
) -> go.Scatter3d:
    """Return points (n, 3); colours: one, or a number for each."""
    x, y, z = np.reshape(places, (-1, 3)).T
    marker = {"size": 3, "color": colours}
    return go.Scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, name=name)


def boxes(
    lower: ArrayLike, upper: ArrayLike, name: str = "", colour: str = BOX
) -> go.Scatter3d:
    """Return the edges of axis-aligned boxes as one trace; both corners are (n, 3)."""
    low, high = np.reshape(lower, (-1, 3)), np.reshape(upper, (-1, 3))
    bits = np.array([[corner >> axis & 1 for axis in range(3)] for corner in range(8)])
    corners = np.where(bits, high[:, None], low[:, None])  # (n, 8, 3)
    edges = corners[:, np.array(EDGES)].reshape(-1, 2, 3)
    return paths(edges, name, colour, width=2.0)


def film(camera: PerspectiveCamera, distance: float = 1.0) -> go.Scatter3d:
    """Return the eye of a camera and the outline of its film at a distance from it."""
    eye = pinhole(camera)
    x, y = eye.x * eye.xres / 2, eye.y * eye.yres / 2
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    corners = [eye.o + distance * (eye.f + a * x + b * y) for a, b in signs]
    outline = [*corners, corners[0]]
    return paths([outline, *([eye.o, corner] for corner in corners)], "camera", "black")


def side_by_side(pictures: Mapping[str, ArrayLike], columns: int = 4) -> go.Figure:
    """Return pictures of one size in rows, each with its title.

    Linear radiance (H, W, 3) is shown by the curve of sRGB; numbers (H, W) from 0 to 1 are
    shown in grey as they are.
    """
    titles, arrays = list(pictures), [np.asarray(one, float) for one in pictures.values()]
    stack = np.stack(arrays)
    coloured, columns = stack.ndim == 4, min(columns, len(titles))
    shown = np.round(255 * (srgb_from_linear(stack) if coloured else stack))
    chart = px.imshow(
        shown, facet_col=0, facet_col_wrap=columns, zmin=0, zmax=255,
        color_continuous_scale="gray", facet_row_spacing=0.08,
    )  # fmt: skip
    for note in chart.layout.annotations:  # "facet_col=0", in rows from the bottom
        note.text = titles[int(note.text.split("=")[1])]
    chart.update_xaxes(visible=False).update_yaxes(visible=False)
    rows, ratio = -(-len(titles) // columns), stack.shape[1] / stack.shape[2]
    height = 80 + rows * min(WIDTH / columns * ratio + 30, 400)
    margin = {"l": 0, "r": 0, "t": 60, "b": 0}
    return chart.update_layout(coloraxis_showscale=False, margin=margin, height=height)

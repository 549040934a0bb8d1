"""A structure that answers rightly and too slowly: the teapot in a stadium."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

import renderer

RINGS, SECTORS = 51, 50  # 5000 triangles

_STADIUM = """<scene version="3.0.0">
<sensor type="perspective"><float name="fov" value="6"/>
    <transform name="to_world">
        <lookat origin="0,-8,2" target="0,0,0" up="0,0,1"/></transform>
    <film type="hdrfilm"><integer name="width" value="16"/>
        <integer name="height" value="16"/><rfilter type="box"/></film>
    <sampler type="stratified"><integer name="sample_count" value="1"/>
        <boolean name="jitter" value="false"/></sampler></sensor>
<shape type="obj"><string name="filename" value="ball.obj"/></shape>
<shape type="obj"><string name="filename" value="field.obj"/></shape>
</scene>"""
_FIELD = """v -500 -500 -0.5
v 500 -500 -0.5
v 500 500 -0.5
v -500 500 -0.5
f 1 2 3
f 1 3 4
"""


def ball_mesh() -> str:
    """Return a sphere of diameter 1 as OBJ."""
    lines = []
    for t in np.pi * np.arange(RINGS + 1) / RINGS:
        for p in 2 * np.pi * np.arange(SECTORS) / SECTORS:
            x, y, z = np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)
            lines.append(f"v {x / 2:.9g} {y / 2:.9g} {z / 2:.9g}")
    for i in range(RINGS):
        for j in range(SECTORS):
            a, b = i * SECTORS + j + 1, i * SECTORS + (j + 1) % SECTORS + 1
            c, d = a + SECTORS, b + SECTORS
            lines += [f"f {a} {c} {d}"] if i < RINGS - 1 else []
            lines += [f"f {a} {d} {b}"] if i > 0 else []
    return "\n".join(lines) + "\n"


def stadium_tests_per_ray(accel: str = "grid") -> float:
    """Return how many triangles a camera ray at the ball is tested against, on average.

    A ball of 5000 triangles, 1 wide, on a field 1000 wide: with about as many cells as
    triangles the ball is in one of them (Haines, Ray Tracing News 1(9), 1988).
    """
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "ball.obj").write_text(ball_mesh())
        (Path(folder) / "field.obj").write_text(_FIELD)
        scene = renderer.load_string(_STADIUM, base_dir=folder)
    image = renderer.render(scene, integrator="work", accel=accel)
    return float(image.aovs["work.primitive_tests"].mean())

"""Mitsuba itself, where its own answer is not the one on paper."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from mitsuba_ref.expected_failures.cost import ball_mesh
from mitsuba_ref.reference.variant import load_mitsuba

RAYS = 4096


def edge_rays_lost(*, robust: bool = False, aside: float = 0.0) -> float:
    """Return the share of rays at points of edges that pass a closed mesh, in Mitsuba.

    From inside a ball of 5000 triangles. `robust` sets the scene parameter
    `embree_use_robust_intersections`, as the harness does (Mitsuba issue 1149). `aside` is
    the distance of the rays' targets from the edge, as a share of the way to the third
    vertex.
    """
    text = ball_mesh()
    rows = [line.split() for line in text.splitlines()]
    vertices = np.array([row[1:] for row in rows if row[0] == "v"], np.float64)
    faces = np.array([row[1:] for row in rows if row[0] == "f"], np.int64) - 1
    rng = np.random.default_rng(3)
    face = faces[rng.integers(0, len(faces), RAYS)]
    first, second, third = (vertices[face[:, k]] for k in range(3))
    origin = rng.uniform(-0.1, 0.1, (RAYS, 3))
    target = first + rng.random((RAYS, 1)) * (second - first)
    direction = target + aside * (third - target) - origin
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)

    mi = load_mitsuba()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ball.obj"
        path.write_text(text)
        shape = {"type": "obj", "filename": str(path), "face_normals": True}
        flag = {"embree_use_robust_intersections": robust}
        scene = mi.load_dict({"type": "scene", **flag, "ball": shape})
    rays = zip(origin.tolist(), direction.tolist(), strict=True)
    hits = sum(bool(scene.ray_test(mi.Ray3f(o, d))) for o, d in rays)
    return 1 - hits / RAYS


# ------------------------------------------------------------------- light on a floor

_FLOOR = """<scene version="3.0.0">
<integrator type="direct"><integer name="emitter_samples" value="{samples}"/>
    <integer name="bsdf_samples" value="0"/></integrator>
<sensor type="perspective"><float name="fov" value="0.01"/>
    <transform name="to_world">
        <lookat origin="3,0,3" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="1"/><integer name="height" value="1"/>
        <string name="component_format" value="float32"/><rfilter type="box"/></film>
    <sampler type="independent"/></sensor>
<shape type="rectangle"><transform name="to_world"><scale value="9"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="1"/></bsdf></shape>
{light}
</scene>"""


def _floor_under(light: str, samples: int) -> float:
    """Return the radiance that Mitsuba gives the middle of a white floor, times pi."""
    mi = load_mitsuba()
    scene = mi.load_string(_FLOOR.format(light=light, samples=samples))
    return float(np.mean(np.array(mi.render(scene, spp=64, seed=1)))) * float(np.pi)


def point_light_sampled_often(samples: int = 4) -> float:
    """Return E h^2 / I below a point light, sampled `samples` times: 1 on paper.

    For points, spots and directional lights each light sample is weighed as if it were the
    only one.
    """
    light = '<emitter type="point"><point name="position" value="0,0,2"/></emitter>'
    return _floor_under(light, samples) * 2.0**2


def lamp_with_vertex_normals(degrees: float = 45.0) -> float:
    """Return E h^2 / (L A) below a small level triangle: 1 on paper.

    Its vertex normals are tilted. The change from area to solid angle takes the cosine of
    the shading normal; that of the triangle's own would be right.
    """
    tilt, size, height = np.radians(degrees), 0.01, 2.0
    corners = ((-size, -size), (0.0, 2 * size), (size, -size))  # seen from below, ccw
    lines = [f"v {x} {y} {height}" for x, y in corners]
    lines += [f"vn {np.sin(tilt):.9g} 0 {-np.cos(tilt):.9g}", "f 1//1 2//1 3//1"]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "lamp.obj"
        path.write_text("\n".join(lines) + "\n")
        shape = f'<string name="filename" value="{path}"/><emitter type="area"/>'
        measured = _floor_under(f'<shape type="obj">{shape}</shape>', 1)
    return measured * height**2 / (3 * size**2)

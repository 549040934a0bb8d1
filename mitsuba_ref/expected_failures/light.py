"""Light that path tracing cannot find, and shading that the geometry does not have."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import renderer

_SENSOR = """<sensor type="perspective"><float name="fov" value="{fov}"/>
    <transform name="to_world">{lookat}</transform>
    <film type="hdrfilm"><integer name="width" value="{size}"/>
        <integer name="height" value="{size}"/><rfilter type="box"/></film>
    <sampler type="stratified"><integer name="sample_count" value="1"/>
        <boolean name="jitter" value="false"/></sampler></sensor>"""


def _sensor(lookat: str, fov: float, size: int) -> str:
    return _SENSOR.format(fov=fov, size=size, lookat=f"<lookat {lookat}/>")


_BALL = """<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="12"/>
    <integer name="rr_depth" value="12"/></integrator>
{sensor}
<shape type="rectangle"><bsdf type="diffuse"/></shape>
<shape type="sphere"><point name="center" x="0" y="{y!r}" z="1.5"/>
    <bsdf type="dielectric"/></shape>
<emitter type="point"><point name="position" value="0,0,5"/></emitter>
</scene>"""


def caustic_of_a_point_light(beside: float = 0.0) -> float:
    """Return the light in the middle below a glass ball, with the ball over without it.

    The ball gathers light there, so the truth is above 1. A path tracer finds 0: glass
    stops shadow rays, and no ray meets a point by chance [Veach1997]. A ball of radius 1
    whose centre is more than 1 from the straight line to the lamp does not block it.
    """
    sensor = _sensor('origin="6,0,1" target="0,0,0" up="0,0,1"', 0.01, 1)
    with_ball, without = (
        float(
            renderer.render(
                renderer.load_string(_BALL.format(sensor=sensor, y=y)), spp=64
            ).pixels.mean()
        )
        for y in (beside, 1e3)
    )
    return with_ball / without


# ------------------------------------------------------------------------- terminator

SEGMENTS = 16
SIZE = 128


def _sphere_mesh(segments: int) -> str:
    """Return a unit sphere of so many patches around as OBJ, with the sphere's normals."""
    rings, lines = segments // 2, []
    for t in np.pi * np.arange(rings + 1) / rings:
        for p in 2 * np.pi * np.arange(segments) / segments:
            x, y, z = np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)
            lines += [f"v {x:.9g} {y:.9g} {z:.9g}", f"vn {x:.9g} {y:.9g} {z:.9g}"]
    for i in range(rings):
        for j in range(segments):
            a, b = i * segments + j + 1, i * segments + (j + 1) % segments + 1
            c, d = a + segments, b + segments
            # at each pole one of the two triangles would have no area
            lines += [f"f {a}//{a} {c}//{c} {d}//{d}"] if i < rings - 1 else []
            lines += [f"f {a}//{a} {d}//{d} {b}//{b}"] if i > 0 else []
    return "\n".join(lines) + "\n"


_TWO_SPHERES = """<scene version="3.0.0">
<integrator type="direct"/>
{sensor}
<bsdf type="diffuse" id="white"><rgb name="reflectance" value="1"/></bsdf>
<shape type="sphere"><point name="center" value="{smooth},0,0"/><ref id="white"/></shape>
<shape type="obj"><string name="filename" value="sphere.obj"/>
    <transform name="to_world"><translate x="{mesh}"/></transform><ref id="white"/></shape>
<emitter type="directional"><vector name="direction" value="-1,0.2,-0.3"/></emitter>
</scene>"""


def terminator_pictures(
    segments: int = SEGMENTS,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a sphere in parallel light and its mesh, (128, 128), where the camera is.

    Seen from 20 radii with the light from the right; 1 is light straight from above.
    """
    sensor = _sensor('origin="0,-20,0" target="0,0,0" up="0,0,1"', 5.9, SIZE)
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "sphere.obj").write_text(_sphere_mesh(segments))
        for places in ({"smooth": 0, "mesh": 900}, {"smooth": 900, "mesh": 0}):
            text = _TWO_SPHERES.format(sensor=sensor, **places)
            scene = renderer.load_string(text, base_dir=folder)
            pictures.append(
                renderer.render(scene).pixels[..., 0].astype(np.float64) * np.pi
            )
    return pictures[0], pictures[1]


def terminator_band(segments: int = SEGMENTS) -> float:
    """Return the RMSE of the mesh in the band where the sphere has 0 < cosine < 0.2.

    A facet that looks away from the light is in its own shadow as a whole, whatever its
    vertex normals say; so the mesh's shadow begins at edges of facets.
    """
    smooth, mesh = terminator_pictures(segments)
    band = (smooth > 0) & (smooth < 0.2) & inside(0.95)
    return float(np.sqrt(np.mean((mesh - smooth)[band] ** 2)))


def inside(radius: float) -> NDArray[np.bool_]:
    """Return the pixels of the terminator pictures within so many radii of the middle."""
    x = (np.arange(SIZE) + 0.5 - SIZE / 2) * (2 * 20 * np.tan(np.radians(5.9 / 2)) / SIZE)
    return np.asarray(x**2 + x[:, None] ** 2 < radius**2)

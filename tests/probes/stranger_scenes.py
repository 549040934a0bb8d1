"""Scenes as strangers write them, on which single precision decides many paths.

Nothing is wrong in them, and yet their replays exceed the usual limits. Each is small, and
the same at every call.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

SIZE = 48

HEAD = """<scene version="3.0.0">
<integrator type="{integrator}"><integer name="max_depth" value="{depth}"/></integrator>
<sensor type="perspective"><float name="fov" value="{fov}"/>
<transform name="to_world"><lookat origin="{origin}" target="{target}" up="0, 1, 0"/>
</transform><sampler type="independent"><integer name="sample_count" value="16"/></sampler>
<film type="hdrfilm"><integer name="width" value="{size}"/>
<integer name="height" value="{size}"/><rfilter type="box"/></film></sensor>
"""
LAMP = """<shape type="rectangle"><transform name="to_world"><scale value="{scale}"/>
<lookat origin="{origin}" target="{target}" up="1, 0, 0.1"/></transform>
<emitter type="area"><rgb name="radiance" value="{radiance}"/></emitter></shape>
"""
LAYERS = ((1.0, 1.5, 1.0), (0.8, 1.33, 1.5), (0.5, 1.5, 1.33))
"""Of glass: radius, index inside and outside."""

GREY = '<bsdf type="diffuse"><rgb name="reflectance" value="{value}"/></bsdf>'


def head(origin="0, 1, 6", target="0, 0, 0", fov=40, depth=6, integrator="path", size=SIZE):
    return HEAD.format(**locals())


def lamp(origin="0, 6, 1", target="0, 0, 0", scale=1, radiance=12):
    return LAMP.format(**locals())


def floor(y=-1.0, at="0, 0", scale=8, value="0.6"):
    x, z = at.split(",")
    return (
        '<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/>'
        f'<scale value="{scale}"/><translate x="{x}" y="{y}" z="{z}"/></transform>'
        f"{GREY.format(value=value)}</shape>\n"
    )


def write_scene(folder: Path, name: str, text: str) -> Path:
    path = folder / f"{name}.xml"
    path.write_text(text + "</scene>\n", encoding="utf-8")
    return path


def thin_triangles_far_away(folder: Path, size=SIZE, count=3000) -> Path:
    """Blades of grass, 0.004 wide, at coordinates of 1e4 (their last bit is 1e-3)."""
    rng = np.random.default_rng(5)
    far = np.array([1e4, 0.0, 1e4])
    foot = np.c_[rng.uniform(-2, 2, count), np.full(count, -1.0), rng.uniform(-2, 2, count)]
    angle = rng.uniform(0, np.pi, count)
    side = 0.004 * np.c_[np.cos(angle), np.zeros(count), np.sin(angle)]
    tip = foot + rng.normal(0, 0.15, (count, 3)) + [0.0, 1.2, 0.0]
    corners = np.stack([foot - side, foot + side, tip], axis=1).reshape(-1, 3) + far
    rows = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in corners]
    rows += [f"f {3 * k + 1} {3 * k + 2} {3 * k + 3}" for k in range(count)]
    (folder / "grass.obj").write_text("\n".join(rows) + "\n", encoding="utf-8")
    text = head("10000, 1, 10006", "10000, 0, 10000", size=size)
    text += lamp("10000, 6, 10001", "10000, 0, 10000") + floor(at="10000, 10000")
    text += '<shape type="obj"><string name="filename" value="grass.obj"/><bsdf type='
    text += f'"twosided">{GREY.format(value="0.2, 0.5, 0.1")}</bsdf></shape>\n'
    return write_scene(folder, "thin-triangles-far-away", text)


def nested_glass(folder: Path, size=SIZE, depth=50) -> Path:
    """Turned onions of glass, water and glass between mirrors, in a chequered room."""
    text = head(fov=32, depth=depth, size=size).replace(
        "</integrator>", '<integer name="rr_depth" value="50"/></integrator>'
    )
    text += lamp(radiance=30)
    text += '<shape type="cube"><transform name="to_world"><scale value="7"/></transform>'
    text += '<bsdf type="twosided"><bsdf type="diffuse"><texture name="reflectance" '
    text += 'type="checkerboard"><transform name="to_uv"><scale value="40"/></transform>'
    text += "</texture></bsdf></bsdf></shape>"
    for k in range(7):
        x, z = (1.05 * np.cos(k), 1.05 * np.sin(k)) if k else (0.0, 0.0)
        for radius, inside, outside in LAYERS:
            text += (
                f'<shape type="sphere"><transform name="to_world"><scale value='
                f'"{0.5 * radius:g}"/><rotate x="0.6" y="0.8" angle="{37 * k + 20}"/>'
                f'<translate x="{x:.4f}" z="{z:.4f}"/></transform>'
            )
            text += (
                '<bsdf type="conductor"/></shape>'
                if k % 2
                else f'<bsdf type="dielectric"><float name="int_ior" value="{inside}"/>'
                f'<float name="ext_ior" value="{outside}"/></bsdf></shape>\n'
            )
    return write_scene(folder, "nested-glass", text)


def coincident_rectangles(folder: Path, size=SIZE) -> Path:
    """A red and a green rectangle in one tilted plane: which of them is hit is rounding."""
    text = head(size=size) + lamp() + floor()
    for colour, angle in (("0.8, 0.1, 0.1", 0), ("0.1, 0.8, 0.1", 30)):
        text += (
            f'<shape type="rectangle"><transform name="to_world"><rotate z="1" '
            f'angle="{angle}"/><rotate x="1" angle="-35"/><rotate y="1" angle="25"/>'
            f'</transform><bsdf type="twosided">{GREY.format(value=colour)}</bsdf>'
            "</shape>\n"
        )
    return write_scene(folder, "coincident-rectangles", text)


def bright_lamp_seen(folder: Path, size=SIZE) -> Path:
    """A lamp 1e4 times as bright as the picture's mean, seen and in a polished plate."""
    text = head(size=size) + floor()
    text += '<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-50"/>'
    text += '<translate x="0.4" y="-0.3"/></transform><bsdf type="roughconductor">'
    text += '<float name="alpha" value="0.01"/></bsdf></shape>'
    text += '<shape type="sphere"><float name="radius" value="0.03"/><point name="center" '
    text += 'x="0.4" y="0.9" z="0"/><emitter type="area"><rgb name="radiance" '
    text += 'value="3000, 2500, 1700"/></emitter></shape>\n'
    return write_scene(folder, "bright-lamp-seen", text)


def nothing_in_sight(folder: Path, size=SIZE) -> Path:
    """The camera looks away from all there is, at an even sky."""
    text = head("0, 1, 6", "0, 1, 20", size=size) + floor(scale=2)
    text += '<emitter type="constant"><rgb name="radiance" value="0.4, 0.5, 0.7"/>'
    text += "</emitter>\n"
    return write_scene(folder, "nothing-in-sight", text)


STRANGERS = {
    make.__name__.replace("_", "-"): make
    for make in (
        thin_triangles_far_away,
        nested_glass,
        coincident_rectangles,
        bright_lamp_seen,
    )
}

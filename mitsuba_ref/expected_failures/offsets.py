"""Where a new ray starts: gaps that a distance jumps over, mirrors that show it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import renderer
from renderer.rendering.job import RenderJob
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.planning.plan import offset_rule
from renderer.rendering.render_loop import run
from renderer.rendering.render_options import RenderOptions

FIXED = (0.0, 1e-3)  # a distance for all, as in many first renderers
TIGHT, MITSUBA = offset_rule("tight")[:2], offset_rule("mitsuba")[:2]

_PANE = """<scene version="3.0.0">
<integrator type="whitted"><integer name="max_depth" value="2"/></integrator>
<sensor type="perspective"><float name="fov" value="0.01"/>
    <transform name="to_world">
        <lookat origin="0,0,-1" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="1"/><integer name="height" value="1"/>
        <rfilter type="box"/></film>
    <sampler type="stratified"><integer name="sample_count" value="1"/>
        <boolean name="jitter" value="false"/></sampler></sensor>
<shape type="rectangle"><transform name="to_world"><scale value="{half}"/></transform>
    <bsdf type="dielectric"/></shape>
<shape type="rectangle">
    <transform name="to_world">
        <rotate x="1" angle="180"/><translate z="{gap!r}"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
    <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>
</scene>"""


def render_with_offset(
    scene: renderer.Scene, rule: tuple[float, float]
) -> NDArray[np.float32]:
    """Render with a rule of one's own: rounding errors, and a share of 1 + max|p|."""
    job = RenderJob(scene, make_plan(scene), RenderOptions(accel="brute", threads=1))
    rounding, fixed = rule
    settings = job.kernel_scene.settings._replace(
        rounding_offset=rounding, fixed_offset=fixed
    )
    film = job.make_film()
    run(job.with_record(job.kernel_scene._replace(settings=settings)), film)
    return np.asarray(film.develop())


def lamp_seen(rule: tuple[float, float], gap: float, half: float = 1.0) -> bool:
    """Return whether a lamp is seen through a pane of half width `half` before it.

    A ray that leaves the glass too far out starts behind the lamp, and sees nothing.
    """
    scene = renderer.load_string(_PANE.format(gap=gap, half=half))
    return bool(render_with_offset(scene, rule).max() > 0.5)


def smallest_gap(rule: tuple[float, float], half: float = 1.0) -> float:
    """Return how near a lamp may be to the glass in front of it and still be seen."""
    low, high = -8.0, 0.0  # log10 of the gap: not seen, seen
    for _ in range(16):
        middle = (low + high) / 2
        seen = lamp_seen(rule, 10**middle, half)
        low, high = (low, middle) if seen else (middle, high)
    return float(10**high)


_TUBE = """<scene version="3.0.0">
<integrator type="whitted"><integer name="max_depth" value="24"/></integrator>
<sensor type="perspective"><float name="fov" value="50"/>
    <transform name="to_world">
        <lookat origin="0,0,6" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="64"/>
        <integer name="height" value="64"/><rfilter type="box"/></film>
    <sampler type="stratified"><integer name="sample_count" value="1"/>
        <boolean name="jitter" value="false"/></sampler></sensor>
<bsdf type="conductor" id="mirror"><string name="material" value="none"/></bsdf>
<bsdf type="diffuse" id="wall"/>
<emitter type="point"><point name="position" value="0.3,0.2,1"/></emitter>
{mirrors}
{strips}
</scene>"""
_MIRROR = """<shape type="rectangle"><transform name="to_world">
    <scale x="1.75" y="3.3" z="1"/><rotate x="1" angle="-90"/><translate y="-1" z="2.7"/>
    <rotate z="1" angle="{angle}"/></transform><ref id="mirror"/></shape>"""
_STRIP = """<shape type="rectangle"><transform name="to_world">
    <scale x="0.1" y="4" z="1"/><translate x="{x}" z="-0.5"/></transform>
    <ref id="wall"/></shape>"""


def tube_of_mirrors_changed() -> float:
    """Return the relative RMSE between both rules, seen down three mirrors.

    Each of up to 22 reflections moves the ray sideways by some of the offset, and at the
    end are bright strips on black, so that pixels at their edges change.
    """
    mirrors = "\n".join(_MIRROR.format(angle=angle) for angle in (0, 120, 240))
    strips = "\n".join(_STRIP.format(x=x) for x in np.linspace(-1.9, 1.9, 11).round(3))
    scene = renderer.load_string(_TUBE.format(mirrors=mirrors, strips=strips))
    tight, theirs = (
        renderer.render(scene, ray_offset=rule).pixels.astype(np.float64)
        for rule in ("tight", "mitsuba")
    )
    return float(np.sqrt(np.mean((tight - theirs) ** 2)) / np.mean(theirs))

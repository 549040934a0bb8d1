"""Paths that end too early, trees of rays, shading normals, dependent random numbers."""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.expected_failures.light import terminator_band, terminator_pictures
from renderer.rendering.job import RenderJob
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.render_loop import run
from renderer.rendering.render_options import RenderOptions
from reports.studies.limits.one_point import MIDDLES, estimates, load_scene, scene_at
from reports.studies.limits.probes import Shown, on_screen

# ----------------------------------------------------------------- fixed depth and roulette

_FURNACE = """<shape type="sphere"><boolean name="flip_normals" value="true"/>
    <bsdf type="diffuse"><rgb name="reflectance" value="{albedo!r}"/></bsdf>
    <emitter type="area"/></shape>"""


def furnace_error(bounces: float, *, depth: int, roulette: int) -> float:
    """Return how far from 1 / (1 - albedo) the light in a white-hot ball is, relatively.

    `bounces` is that sum itself: as many segments carry light on average [Arvo1990].
    """
    body = _FURNACE.format(albedo=1.0 - 1.0 / bounces)
    lookat = 'origin="0,0,0" target="0,1,0" up="0,0,1"'
    scene = scene_at(body, lookat, depth=depth, roulette=roulette, fov=90.0)
    return abs(float(np.mean(estimates(scene, 64))) / bounces - 1.0)


# ------------------------------------------------------------------------- trees of rays

_SURFACE = """<shape type="rectangle"><transform name="to_world"><scale value="99"/>
    <rotate x="1" angle="{angle}"/><translate z="{z}"/></transform>{inside}</shape>"""
_LAMP = """<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
    <emitter type="area"/>"""
_GLASS = """<bsdf type="dielectric"><float name="int_ior" value="1.5"/>
    <float name="ext_ior" value="1"/></bsdf>"""


def _seen(body: str, depth: int, cutoff: float = 1e-6) -> float:
    """Return the one pixel of a scene, with trees of so many segments."""
    loop = (
        f'<integrator type="whitted"><float name="cutoff" value="{cutoff}"/></integrator>'
    )
    lookat = 'origin="0,0,0" target="0,0,1" up="0,1,0"'
    scene = load_scene(body, lookat, loop, size=1, sampler=MIDDLES)
    plan = dataclasses.replace(make_plan(scene), max_depth=depth)
    job = RenderJob(scene, plan, RenderOptions(accel="brute", threads=1))
    film = job.make_film()
    run(job, film)
    return float(film.develop()[0, 0, 0])


def _lost_in_panes(panes: float, *, depth: int) -> float:
    """Return the share of a lamp's light that so deep a tree of rays loses in glass.

    n panes pass (1 - r) / (1 + (2 n - 1) r), r = 0.04 of each surface [Stokes1862].
    """
    count, r = round(panes), 0.04
    surfaces = [
        _SURFACE.format(angle=angle, z=1 + k + thickness, inside=_GLASS)
        for k in range(count)
        for angle, thickness in ((180, 0.0), (0, 0.5))
    ]
    lamp = _SURFACE.format(angle=180, z=count + 2, inside=_LAMP)
    seen = _seen("".join(surfaces) + lamp, depth)
    return abs(1.0 - seen * (1 + (2 * count - 1) * r) / (1 - r))


def rays_of_a_tree(splits: float, *, cutoff: float = 1e-6) -> float:
    """Return how many rays a tree has that splits so many times, counted by its picture.

    The camera stands amid thin panes that shine by themselves and divide light into
    halves: 2 r / (1 + r) = 1/2 at an index of 3.73. A ray after k splits carries 2^-k, so
    that what arrives after k splits tells how many rays do. A pane shines to one side, so
    rays of either direction are counted by a render each.
    """
    index = (1 + 3**-0.5) / (1 - 3**-0.5)
    pane = f"""<bsdf type="thindielectric"><float name="int_ior" value="{index!r}"/>
        <float name="ext_ior" value="1"/></bsdf><emitter type="area"/>"""
    deepest = round(splits)
    places = [k + 0.5 for k in range(-deepest - 1, deepest + 1)]
    bodies = [
        "".join(_SURFACE.format(angle=angle, z=z, inside=pane) for z in places)
        for angle in (0, 180)
    ]
    rays, before = 0, 0.0
    for split in range(deepest + 1):
        arrived = sum(_seen(body, split + 1, cutoff) for body in bodies)
        rays += round(2**split * (arrived - before))
        before = arrived
    return float(rays)


# ----------------------------------------------------- the same random numbers everywhere

_PENUMBRA = """<shape type="rectangle"><bsdf type="diffuse"/></shape>
<shape type="rectangle"><transform name="to_world"><scale value="0.3"/>
    <rotate x="1" angle="180"/><translate z="2"/></transform><emitter type="area"/></shape>
<shape type="rectangle"><transform name="to_world"><translate x="{edge!r}" z="1"/>
    </transform><bsdf type="diffuse"/></shape>"""


def _neighbours(pixels: int, same_stream: bool) -> NDArray[np.float64]:
    """Return 1024 estimates of neighbouring pixels in a penumbra, (pixels, 1024)."""
    lookat = 'origin="3,0,0.5" target="0,0,0" up="0,0,1"'
    return np.stack(
        [
            estimates(
                scene_at(_PENUMBRA.format(edge=1.0 + 0.001 * k), lookat),
                4,
                seed=7 if same_stream else 7 + k,
            )
            for k in range(pixels)
        ]
    )


def _error_of_a_mean(pixels: float, *, same_stream: bool) -> float:
    """Return the error of the mean of neighbouring pixels, over what it should be.

    The mean of n of them should have an error of one pixel's over the root of n; one pixel
    is its own measure, 1 by construction.
    """
    values = _neighbours(round(pixels), same_stream)
    errors = values - values.mean(axis=1, keepdims=True)
    errors /= values.std(axis=1, keepdims=True)
    return float(np.std(errors.mean(axis=0)) * len(errors) ** 0.5)


def streaks() -> Shown:
    """Show rows of 16 pixels with one stream of random numbers, and with one of each."""
    pictures = [_neighbours(16, same)[:, :32].T for same in (True, False)]
    return on_screen(pictures, exposure=0.5 / float(np.mean(pictures)), enlarged=10)


# ------------------------------------------------------------------------------- strata

_STRIPES = """<scene version="3.0.0">
<integrator type="direct"/>
<sensor type="orthographic">
    <transform name="to_world">
        <lookat origin="0,0,1" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="32"/>
        <integer name="height" value="32"/><rfilter type="box"/></film>
    <sampler type="{sampler}"><integer name="sample_count" value="16"/>{jitter}</sampler>
</sensor>
<shape type="rectangle"><bsdf type="diffuse"><texture type="checkerboard"
    name="reflectance"><rgb name="color0" value="0"/><rgb name="color1" value="1"/>
    <transform name="to_uv"><scale value="{scale!r}"/></transform></texture></bsdf></shape>
<emitter type="directional"><vector name="direction" value="0,0,-1"/></emitter>
</scene>"""


def error_at_stripes(finest: float, *, sampler: str, jitter: bool = True) -> float:
    """Return the relative RMSE of 16 samples a pixel of the worst checkerboard.

    Parameters
    ----------
    finest : float
        The checkerboards have 1, 2, 3 and so on to so many periods, two squares each, in
        a pixel; whole numbers leave it grey. The worst of them counts, because strata
        without jitter are wrong at multiples of their number a side, right at others.
    sampler : str
        Name of the sampler.
    jitter : bool
        Whether the strata's samples are anywhere in them, or in their middle.
    """
    shares = (
        _white(float(periods), sampler, jitter=jitter)
        for periods in range(1, int(finest) + 1)
    )
    return max(float(np.sqrt(np.mean((share - 0.5) ** 2)) / 0.5) for share in shares)


def _white(periods: float, sampler: str, *, jitter: bool = True) -> NDArray[np.float64]:
    """Return the share of white squares that each pixel finds, (32, 32)."""
    switch = "" if jitter else '<boolean name="jitter" value="false"/>'
    text = _STRIPES.format(sampler=sampler, jitter=switch, scale=32.0 * periods)
    image = renderer.render(renderer.load_string(text), integrator="direct")
    return image.pixels[..., 0].astype(np.float64) * np.pi


def stripes() -> Shown:
    """Show 4.1 periods a pixel, which should be grey, without jitter and with it."""
    pictures = [_white(4.1, "stratified", jitter=jitter) for jitter in (False, True)]
    return on_screen(pictures, enlarged=6)


MEASURES = {
    "furnace-fixed-depth": partial(furnace_error, depth=16, roulette=1000),
    "furnace-roulette": partial(furnace_error, depth=-1, roulette=5),
    "glass-depth": partial(_lost_in_panes, depth=8),
    "glass-depth-enough": partial(_lost_in_panes, depth=24),
    "whitted-tree": rays_of_a_tree,
    "whitted-tree-cutoff": partial(rays_of_a_tree, cutoff=1 / 65),
    "terminator": lambda degrees: terminator_band(round(360 / degrees)),
    "same-stream": partial(_error_of_a_mean, same_stream=True),
    "hashed-streams": partial(_error_of_a_mean, same_stream=False),
    "strata-without-jitter": partial(error_at_stripes, sampler="stratified", jitter=False),
    "strata-with-jitter": partial(error_at_stripes, sampler="stratified"),
    "independent-samples": partial(error_at_stripes, sampler="independent"),
}
PICTURES = {
    "terminator": lambda: on_screen(terminator_pictures()),
    "same-stream": streaks,
    "strata": stripes,
}

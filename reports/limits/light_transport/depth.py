"""How deep to follow light: fixed depth and roulette, glass behind glass, trees of rays."""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np

import renderer
from renderer.rendering.job import RenderJob
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.render_loop import run
from renderer.rendering.render_options import RenderOptions
from reports.limits.light_transport.one_point import estimates, scene_at
from reports.limits.row import Row

DEPTH = 16

_FURNACE = """<shape type="sphere"><boolean name="flip_normals" value="true"/>
    <bsdf type="diffuse"><rgb name="reflectance" value="{albedo!r}"/></bsdf>
    <emitter type="area"/></shape>"""


def furnace_error(bounces: float, *, depth: int, roulette: int) -> float:
    """Return how far from 1 / (1 - albedo) the light in a white-hot ball is, relatively.

    `bounces` is that sum itself: as many segments carry light on average [Arvo1990].
    """
    scene = scene_at(
        _FURNACE.format(albedo=1.0 - 1.0 / bounces),
        'origin="0,0,0" target="0,1,0" up="0,0,1"',
        depth=depth,
        roulette=roulette,
        fov=90.0,
    )
    return abs(float(np.mean(estimates(scene, 64))) / bounces - 1.0)


_TREE = """<scene version="3.0.0">
<integrator type="whitted"><float name="cutoff" value="{cutoff}"/></integrator>
<sensor type="perspective"><float name="fov" value="0.001"/>
    <transform name="to_world">
        <lookat origin="0,0,0" target="0,0,1" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="1"/><integer name="height" value="1"/>
        <rfilter type="box"/></film>
    <sampler type="stratified"><integer name="sample_count" value="1"/>
        <boolean name="jitter" value="false"/></sampler></sensor>
{body}
</scene>"""
_LAMP = """<shape type="rectangle"><transform name="to_world"><scale value="99"/>
    <rotate x="1" angle="180"/><translate z="{z}"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
    <emitter type="area"/></shape>"""
_SURFACE = """<shape type="rectangle"><transform name="to_world"><scale value="99"/>
    <rotate x="1" angle="{angle}"/><translate z="{z}"/></transform>{inside}</shape>"""
_GLASS = """<bsdf type="dielectric"><float name="int_ior" value="1.5"/>
    <float name="ext_ior" value="1"/></bsdf>"""


def _seen(scene: renderer.Scene, depth: int) -> float:
    """Return the one pixel of a scene, with trees of so many segments."""
    plan = dataclasses.replace(make_plan(scene), max_depth=depth)
    job = RenderJob(scene, plan, RenderOptions(accel="brute", threads=1))
    film = job.make_film()
    run(job, film)
    return float(film.develop()[0, 0, 0])


def light_lost_in_panes(panes: float, *, depth: int) -> float:
    """Return the share of a lamp's light that so deep a tree of rays loses in glass.

    n panes pass (1 - r) / (1 + (2 n - 1) r), r = 0.04 of each surface [Stokes1862].
    """
    count, r = round(panes), 0.04
    surfaces = (
        _SURFACE.format(angle=angle, z=1 + k + thickness, inside=_GLASS)
        for k in range(count)
        for angle, thickness in ((180, 0.0), (0, 0.5))
    )
    body = "".join(surfaces) + _LAMP.format(z=count + 2)
    scene = renderer.load_string(_TREE.format(body=body, cutoff=1e-6))
    seen = _seen(scene, depth)
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
    scenes = []
    for angle in (0, 180):
        body = "".join(_SURFACE.format(angle=angle, z=z, inside=pane) for z in places)
        scenes.append(renderer.load_string(_TREE.format(body=body, cutoff=cutoff)))
    rays, before = 0, 0.0
    for split in range(deepest + 1):
        arrived = sum(_seen(scene, split + 1) for scene in scenes)
        rays += round(2**split * (arrived - before))
        before = arrived
    return float(rays)


_ALBEDO = "bounces that carry light on average, 1 / (1 - albedo)"
_BOUNCES = (1.25, 2.0, 10 / 3, 5.0, 10.0, 20.0)

ROWS = (
    Row(
        name="furnace-fixed-depth",
        method=f"Path tracing of {DEPTH} segments",
        stress=_ALBEDO,
        measure=partial(furnace_error, depth=DEPTH, roulette=1000),
        quantity="error",
        unit="of the light",
        strengths=_BOUNCES,
        tolerance=0.01,
        holds_at=10 / 3,
        fails_at=5.0,
        why="What is cut off is albedo^16: 3 % at an albedo of 0.8 (4.859 instead of 5), "
        "and it looks like a darker room, not like an error.",
        instead="Russian roulette, which ends paths without a bias.",
        source="[Arvo1990]; measured here",
    ),
    Row(
        name="furnace-roulette",
        method="Path tracing with Russian roulette",
        stress=_ALBEDO,
        measure=partial(furnace_error, depth=-1, roulette=5),
        quantity="error",
        unit="of the light",
        strengths=_BOUNCES,
        tolerance=0.01,
        holds_at=20.0,
        fails_at=None,
        why="Each path that survives carries the share of those that ended.",
        instead="This is the method to use.",
        source="[Arvo1990]; measured here",
    ),
    Row(
        name="glass-depth",
        method="Rays followed over 8 segments",
        stress="panes of glass in front of the lamp",
        measure=partial(light_lost_in_panes, depth=8),
        quantity="error",
        unit="of the light lost",
        strengths=(1.0, 2.0, 3.0, 4.0, 5.0),
        tolerance=0.01,
        holds_at=2.0,
        fails_at=4.0,
        why="n panes need 2 n + 1 segments to be seen through at all, and two more for "
        "each reflection between them.",
        instead="A limit of four segments a pane and more; the series ends by itself.",
        source="[Stokes1862]; measured here",
    ),
    Row(
        name="glass-depth-enough",
        method="Rays followed over 24 segments",
        stress="panes of glass in front of the lamp",
        measure=partial(light_lost_in_panes, depth=24),
        quantity="error",
        unit="of the light lost",
        strengths=(1.0, 2.0, 3.0, 4.0, 5.0),
        tolerance=0.01,
        holds_at=5.0,
        fails_at=None,
        why="What is still under way after that has been reflected too often to matter.",
        instead="This is the method to use.",
        source="[Stokes1862]; measured here",
    ),
    Row(
        name="whitted-tree",
        method="A tree of rays, both ways at each pane",
        stress="panes in a row that a ray can meet",
        measure=rays_of_a_tree,
        quantity="cost",
        unit="rays a camera ray",
        strengths=(1.0, 2.0, 4.0, 6.0, 7.0, 8.0, 9.0, 10.0),
        tolerance=500.0,
        holds_at=7.0,
        fails_at=8.0,
        why="Each depth has twice the rays of the one before: 2^(d + 1) - 1 in all.",
        instead="Path tracing, which takes one of the two ways, or a cutoff.",
        source="[Whitted1980]; measured here",
    ),
    Row(
        name="whitted-tree-cutoff",
        method="A tree of rays without branches of less than 1/64",
        stress="panes in a row that a ray can meet",
        measure=partial(rays_of_a_tree, cutoff=1 / 65),
        quantity="cost",
        unit="rays a camera ray",
        strengths=(1.0, 2.0, 4.0, 6.0, 7.0, 8.0, 9.0, 10.0),
        tolerance=500.0,
        holds_at=10.0,
        fails_at=None,
        why="All branches together carry the light of one ray, so that few of them can "
        "be heavy.",
        instead="This is the method to use; what is dropped is a bias that the cutoff "
        "bounds.",
        source="[Hall1983]; measured here",
    ),
)

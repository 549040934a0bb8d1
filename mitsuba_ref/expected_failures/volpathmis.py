"""Mitsuba's `volpathmis`, where its answer is not the one on paper."""

from __future__ import annotations

from math import exp

import numpy as np

from mitsuba_ref.reference.variant import load_mitsuba

_SCENE = """<scene version="3.0.0">
<integrator type="volpathmis"><integer name="max_depth" value="{depth}"/>
    <integer name="rr_depth" value="{roulette}"/>
    <boolean name="use_spectral_mis" value="{spectral}"/></integrator>
<sensor type="perspective"><float name="fov" value="0.01"/>
    <transform name="to_world">
        <lookat origin="0,0,{z}" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="16"/>
        <integer name="height" value="16"/>
        <string name="component_format" value="float32"/><rfilter type="box"/></film>
    <sampler type="independent"/></sensor>
<emitter type="constant"/>
{shapes}
</scene>"""
_BALL = """<shape type="sphere"><bsdf type="null"/>
<medium type="homogeneous" name="interior">
    <rgb name="sigma_t" value="{sigma_t}"/><float name="scale" value="{scale}"/>
    <float name="albedo" value="{albedo}"/>
    <boolean name="has_spectral_extinction" value="{spectral}"/></medium></shape>"""
_FLOOR = """<shape type="rectangle">
    <transform name="to_world"><scale value="0.1"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="{reflectance}"/></bsdf></shape>
"""
_LAMP = """<shape type="sphere"><bsdf type="null"/>
    <boolean name="flip_normals" value="true"/>{emitter}</shape>"""
_PANES = """<shape type="sphere"><bsdf type="thindielectric">
    <float name="int_ior" value="1.5"/><float name="ext_ior" value="1.5"/>
    <rgb name="specular_transmittance" value="{passes}"/></bsdf></shape>"""


def _seen(
    shapes: str,
    *,
    z: float,
    depth: int,
    roulette: int = 1000,
    spectral: bool = True,
    spp: int = 64,
) -> tuple[float, float, float]:
    """Return the mean colour that Mitsuba shows under a sky of radiance 1."""
    mi = load_mitsuba()
    text = _SCENE.format(
        depth=depth, roulette=roulette, spectral=str(spectral).lower(), z=z, shapes=shapes
    )
    picture = np.array(mi.render(mi.load_string(text), spp=spp, seed=1))
    red, green, blue = picture.mean(axis=(0, 1))
    return float(red), float(green), float(blue)


def white_mist_with_roulette(rr_depth: int = 2) -> float:
    """Return the radiance of a ball that absorbs nothing, under a sky of 1: 1 on paper."""
    ball = _BALL.format(sigma_t="1, 1, 1", scale=4.0, albedo=1.0, spectral="true")
    return _seen(ball, z=5.0, depth=1000, roulette=rr_depth, spp=256)[0]


def floor_behind_a_tinted_pane(passes: float = 0.3) -> float:
    """Return the radiance of a white floor in a tinted ball, over what passes: 1 on paper.

    The ball is a pane of the index of what is around, which mirrors nothing.
    """
    panes = _PANES.format(passes=f"{passes}, {passes}, {passes}")
    shapes = _FLOOR.format(reflectance="1, 1, 1") + panes
    return _seen(shapes, z=0.5, depth=2, spp=256)[0] / passes


def floor_in_a_clear_lamp(*, shines: bool = True) -> float:
    """Return the radiance of a white floor in a ball that light passes: 1 on paper.

    The ball shines by 0.001 of the sky, which is taken off.
    """
    lamp = '<emitter type="area"><rgb name="radiance" value="0.001"/></emitter>'
    ball = _LAMP.format(emitter=lamp * shines)
    shapes = _FLOOR.format(reflectance="1, 1, 1") + ball
    return _seen(shapes, z=0.5, depth=2, spp=256)[0] - 0.001 * shines


def red_floor_by_one_density(*, green: float = 0.0) -> float:
    """Return the red of a floor without use_spectral_mis: 1 on paper."""
    shapes = _FLOOR.format(reflectance=f"1, {green}, {green}")
    return _seen(shapes, z=0.5, depth=2, spectral=False)[0]


def blue_in_coloured_mist(*, spectral: bool = False) -> float:
    """Return the blue behind what absorbs red, without spectral extinction: 1 on paper.

    Over exp(-sigma_t 2) of blue.
    """
    kept = str(spectral).lower()
    ball = _BALL.format(sigma_t="0.9, 0.5, 0.1", scale=1.0, albedo=0.0, spectral=kept)
    return _seen(ball, z=5.0, depth=2, spp=256)[2] / exp(-0.2)

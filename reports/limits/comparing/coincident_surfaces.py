"""Coincident surfaces: which of the two is seen is decided by the last bit of a float."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.reference.variant import load_mitsuba
from reports.limits.row import Row
from reports.limits.screen import on_screen

DISTANCE = 8.0  # of the camera
DIFFERENT = 0.1  # radiance; the squares have 0.7 and 0.2

_SCENE = """<scene version="3.0.0">
<integrator type="direct"/>
<sensor type="perspective"><float name="fov" value="30"/>
    <transform name="to_world"><lookat origin="0,-6.93,4" target="0,0,0" up="0,0,1"/>
        {tilt}</transform>
    <film type="hdrfilm"><integer name="width" value="48"/>
        <integer name="height" value="32"/><string name="component_format" value="float32"/>
        <rfilter type="box"/></film>
    <sampler type="stratified"><integer name="sample_count" value="1"/>
        <boolean name="jitter" value="false"/></sampler></sensor>
<shape type="rectangle"><transform name="to_world"><scale value="3"/>{tilt}</transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.8"/></bsdf></shape>
<shape type="rectangle"><transform name="to_world"><scale value="1.7"/>
        <rotate z="1" angle="25"/><translate x="0.3" y="0.2" z="{gap!r}"/>{tilt}</transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="{upper}"/></bsdf></shape>
<emitter type="directional"><transform name="to_world">
    <lookat origin="1,-1,5" target="0,0,0" up="0,1,0"/>{tilt}</transform>
    <rgb name="irradiance" value="3"/></emitter>
</scene>"""
_TILT = '<rotate x="1" angle="40"/><rotate y="1" angle="20"/>'


def _ours(text: str, accel: str | None = None) -> NDArray[np.float32]:
    return renderer.render(renderer.load_string(text), accel=accel).pixels[..., 0]


def _theirs(text: str) -> NDArray[np.float32]:
    mi = load_mitsuba()
    return np.array(mi.render(mi.load_string(text), seed=1), np.float32)[..., 0]


def _text(distance_over_gap: float, upper: float = 0.2) -> str:
    return _SCENE.format(gap=DISTANCE / distance_over_gap, tilt=_TILT, upper=upper)


def pixels_apart(distance_over_gap: float, *, upper: float = 0.2) -> float:
    """Return the share of the upper square's pixels where two renderers disagree.

    A small square above a white one, by this renderer and by Mitsuba; `upper` is its
    reflectance.
    """
    text = _text(distance_over_gap, upper)
    return _share(np.abs(_ours(text) - _theirs(text)) > DIFFERENT)


def pixels_apart_between_structures(distance_over_gap: float) -> float:
    """Return the same between two structures of this renderer."""
    text = _text(distance_over_gap)
    return _share(_ours(text, "brute") != _ours(text, "bvh"))


def _share(apart: NDArray[np.bool_]) -> float:
    """Return the share of the pixels that show the upper square where it is apart."""
    return float(np.mean(apart[_ours(_text(100.0)) < 0.5]))


def surfaces_seen() -> NDArray[np.uint8]:
    """Show a gap of 1e-8 of the distance by this renderer and by Mitsuba."""
    text = _text(1e8)
    return on_screen((_ours(text), _theirs(text)), enlarged=4)


_GAPS = (1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9)
_STRESS = "distance over the gap between the surfaces"
_UNIT = "of the pixels differ"

ROWS = (
    Row(
        name="coincident-surfaces",
        method="Two right renderers, surfaces of different material",
        stress=_STRESS,
        measure=pixels_apart,
        quantity="error",
        unit=_UNIT,
        strengths=_GAPS,
        tolerance=0.01,
        holds_at=1e6,
        fails_at=1e8,
        why="A gap of less than the rounding error of the distance, 6e-8 of it, leaves it "
        "to rounding which surface is nearer.",
        instead="A gap of a millionth of the distance or more, or one surface with a mask; "
        "boxes that stand on a floor sunk into it.",
        source="measured here",
        picture=surfaces_seen,
        caption="A dark square 1e-8 of the distance above a white floor, by this renderer "
        "and by Mitsuba.",
    ),
    Row(
        name="coincident-same-material",
        method="Two right renderers, surfaces of one material",
        stress=_STRESS,
        measure=partial(pixels_apart, upper=0.8),
        quantity="error",
        unit=_UNIT,
        strengths=_GAPS,
        tolerance=0.01,
        holds_at=1e9,
        fails_at=None,
        why="It does not matter which of them is seen, if their normals point to one side "
        "and no texture tells them apart.",
        instead="This is the scene to use, if the surfaces have to coincide.",
        source="measured here",
    ),
    Row(
        name="coincident-one-renderer",
        method="Two structures of one renderer, surfaces of different material",
        stress=_STRESS,
        measure=pixels_apart_between_structures,
        quantity="error",
        unit=_UNIT,
        strengths=_GAPS,
        tolerance=0.0,
        holds_at=1e9,
        fails_at=None,
        why="The same arithmetic rounds alike, and of equal distances all structures take "
        "the primitive that comes first.",
        instead="It tells nothing of another renderer: compare with one.",
        source="measured here",
    ),
)

"""Comparing pictures: coincident surfaces, heavy tails, metrics that miss a defect."""

from __future__ import annotations

import functools
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.metrics import distances
from mitsuba_ref.reference.variant import load_mitsuba
from reports.studies.limits.lamps import light_below_lamp
from reports.studies.limits.one_point import load_scene
from reports.studies.limits.probes import Shown, on_screen

# ------------------------------------------------------------------------ two surfaces

DISTANCE = 8.0  # of the camera
DIFFERENT = 0.1  # radiance; the squares have 0.7 and 0.2

_SQUARES = """<scene version="3.0.0">
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


def _squares(distance_over_gap: float, upper: float = 0.2) -> str:
    return _SQUARES.format(gap=DISTANCE / distance_over_gap, tilt=_TILT, upper=upper)


def _pixels_apart(distance_over_gap: float, *, upper: float = 0.2) -> float:
    """Return the share of the upper square's pixels where two renderers disagree.

    A small square above a white one, by this renderer and by Mitsuba; `upper` is its
    reflectance.
    """
    text = _squares(distance_over_gap, upper)
    return _share(np.abs(_ours(text) - _theirs(text)) > DIFFERENT)


def _structures_apart(distance_over_gap: float) -> float:
    """Return the same between two structures of this renderer."""
    text = _squares(distance_over_gap)
    return _share(_ours(text, "brute") != _ours(text, "bvh"))


def _share(apart: NDArray[np.bool_]) -> float:
    """Return the share of the pixels that show the upper square where it is apart."""
    return float(np.mean(apart[_ours(_squares(100.0)) < 0.5]))


def surfaces() -> Shown:
    """Show a gap of 1e-8 of the distance by this renderer and by Mitsuba."""
    text = _squares(1e8)
    return on_screen((_ours(text), _theirs(text)), enlarged=6)


# ------------------------------------------------------------------------- heavy tails


def _seeds_needed(distance_over_radius: float, *, ball: bool) -> float:
    """Return over how many seeds an RMSE is to be averaged to be known to 5 %.

    64 pictures of 64 pixels, below a lamp behind a glass ball or without it. The pixels are
    alike, so that the truth is the mean of all. Normal errors need 3.1: the RMSE of n of
    them varies by one over the root of 2 n.
    """
    values = light_below_lamp(distance_over_radius, ball=ball, spp=16, size=64)
    errors = values.reshape(64, 64) - np.mean(values)
    rmse = np.sqrt(np.mean(errors**2, axis=1))
    return float((np.std(rmse, ddof=1) / np.mean(rmse) / 0.05) ** 2)


# ---------------------------------------------------------------- metrics and defects

Picture = NDArray[np.float64]
Metric = Callable[[Picture, Picture], float]

SIZE = 64
DRAWS = 2  # pairs of noises that are averaged ...
DRAWS_OF_MEANS = 64  # ... where a metric is one small number that may be 0 by chance

_STRATIFIED = """<sampler type="stratified">
    <integer name="sample_count" value="64"/></sampler>"""
_BODY = """<shape type="rectangle"><transform name="to_world"><scale value="3"/></transform>
    <bsdf type="diffuse"><texture type="checkerboard" name="reflectance">
        <transform name="to_uv"><scale value="5"/></transform></texture></bsdf></shape>
<shape type="sphere"><point name="center" value="0.5,0,1"/>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.7,0.3,0.2"/></bsdf></shape>
<emitter type="directional"><vector name="direction" value="-1,0.2,-2"/>
    <rgb name="irradiance" value="3"/></emitter>
<emitter type="point"><point name="position" value="-2,-3,2"/>
    <rgb name="intensity" value="3"/></emitter>"""


@functools.cache
def right_picture() -> Picture:
    """Return the picture without noise, (64, 64, 3)."""
    lookat = 'origin="4,-4,3" target="0,0,0.4" up="0,0,1"'
    loop = '<integrator type="direct"/>'
    scene = load_scene(_BODY, lookat, loop, size=SIZE, fov=40.0, sampler=_STRATIFIED)
    return renderer.render(scene).pixels.astype(np.float64)


def noisy(picture: Picture, amount: float, random: np.random.Generator) -> Picture:
    """Return the picture with grey noise of this relative deviation, and the same mean."""
    if amount == 0.0:
        return picture
    shape = amount**-2.0
    factors = random.gamma(shape, 1.0 / shape, (*picture.shape[:2], 1))
    return np.asarray(picture * factors)


def _blurred(picture: Picture) -> Picture:
    """Return the means of 3 x 3 pixels, as a filter too wide makes them."""
    padded = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge")
    parts = (padded[y : y + SIZE, x : x + SIZE] for y in range(3) for x in range(3))
    return np.asarray(sum(parts) / 9.0)


def _with_firefly(picture: Picture) -> Picture:
    struck = picture.copy()
    struck[SIZE // 4, SIZE // 4] = 100.0 * picture.max()
    return struck


DEFECTS: dict[str, Callable[[Picture, np.random.Generator], Picture]] = {
    "shift": lambda picture, random: np.roll(picture, 1, axis=1),
    "brightness": lambda picture, random: picture * 1.01,
    "blur": lambda picture, random: _blurred(picture),
    "noise": lambda picture, random: noisy(picture, 0.05, random),
    "firefly": lambda picture, random: _with_firefly(picture),
    "mirror": lambda picture, random: picture[:, ::-1],
}
METRICS: dict[str, Metric] = {
    "rmse": distances.rmse,
    "ssim": lambda a, b: 1.0 - (distances.ssim(a, b) or 0.0),
    "flip": distances.flip,
    "mean": lambda a, b: abs(distances.mean_difference(a, b)),
    "tiles": distances.tile_rmse,
}


def _hidden_share(noise: float, *, metric: str, defect: str) -> float:
    """Return what a metric says of noise alone, over what it says of noise and defect."""
    picture, random = right_picture(), np.random.default_rng(5)
    alone = with_defect = 0.0
    for _ in range(DRAWS_OF_MEANS if metric == "mean" else DRAWS):
        first, second, wrong = (noisy(picture, noise, random) for _ in range(3))
        alone += METRICS[metric](second, first)
        # the film's noise comes first, what the defect does to a picture after it
        with_defect += METRICS[metric](DEFECTS[defect](wrong, random), first)
    return alone / with_defect


def _defect_seen(defect: str) -> Shown:
    """Show the right picture and the one with a defect."""
    right, random = right_picture(), np.random.default_rng(5)
    return on_screen([right, DEFECTS[defect](right, random)], enlarged=4)


MEASURES = {
    "coincident-surfaces": _pixels_apart,
    "coincident-same-material": partial(_pixels_apart, upper=0.8),
    "coincident-one-renderer": _structures_apart,
    "rmse-seeds-caustic": partial(_seeds_needed, ball=True),
    "rmse-seeds-without-glass": partial(_seeds_needed, ball=False),
    **{
        f"{metric}-{defect}": partial(_hidden_share, metric=metric, defect=defect)
        for defect in DEFECTS
        for metric in METRICS
        if metric in ("rmse", "ssim", "flip")
        or (metric, defect) in (("tiles", "shift"), ("tiles", "brightness"))
        or (metric, defect) == ("mean", "brightness")
    },
}
PICTURES = {
    "coincident-surfaces": surfaces,
    **{f"metrics-{defect}": partial(_defect_seen, defect) for defect in DEFECTS},
}

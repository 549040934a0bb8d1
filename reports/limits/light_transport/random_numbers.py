"""Random numbers that are not as independent as the estimator believes."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

import renderer
from reports.limits.light_transport.one_point import estimates, scene_at
from reports.limits.row import Row
from reports.limits.screen import on_screen

_PENUMBRA = """<shape type="rectangle"><bsdf type="diffuse"/></shape>
<shape type="rectangle"><transform name="to_world"><scale value="0.3"/>
    <rotate x="1" angle="180"/><translate z="2"/></transform><emitter type="area"/></shape>
<shape type="rectangle"><transform name="to_world"><translate x="{edge!r}" z="1"/>
    </transform><bsdf type="diffuse"/></shape>"""


def error_of_a_mean(pixels: float, *, same_stream: bool) -> float:
    """Return the error of the mean of neighbouring pixels, over what it should be.

    Pixels in a penumbra, each a little further than the one before, and each estimated
    1024 times. The mean of n of them should have an error of one pixel's over the root
    of n; one pixel is its own measure, 1 by construction.
    """
    errors = []
    for k in range(round(pixels)):
        body = _PENUMBRA.format(edge=1.0 + 0.001 * k)
        scene = scene_at(body, 'origin="3,0,0.5" target="0,0,0" up="0,0,1"')
        values = estimates(scene, 4, seed=7 if same_stream else 7 + k)
        errors.append((values - np.mean(values)) / np.std(values))
    return float(np.std(np.mean(errors, axis=0)) * len(errors) ** 0.5)


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


def stripes_seen() -> NDArray[np.uint8]:
    """Show 4.1 periods a pixel, which should be grey, without jitter and with it."""
    pictures = [_white(4.1, "stratified", jitter=jitter) for jitter in (False, True)]
    return on_screen(pictures, enlarged=6)


_PERIODS = (1.0, 2.0, 3.0, 4.0, 8.0, 12.0)
_MEANS = (1.0, 2.0, 4.0, 8.0, 16.0)

ROWS = (
    Row(
        name="same-stream",
        method="The same random numbers in every pixel",
        stress="neighbouring pixels averaged",
        measure=partial(error_of_a_mean, same_stream=True),
        quantity="error",
        unit="times what independent pixels have",
        strengths=_MEANS,
        tolerance=1.2,
        holds_at=1.0,
        fails_at=4.0,
        why="One pixel is as good as any, 1 by construction; but its neighbours are wrong "
        "in the same direction, so that a filter or the eye averages nothing out.",
        instead="Numbers that are a hash of pixel, sample and dimension.",
        source="measured here",
    ),
    Row(
        name="hashed-streams",
        method="Random numbers hashed with another seed for each pixel",
        stress="neighbouring pixels averaged",
        measure=partial(error_of_a_mean, same_stream=False),
        quantity="error",
        unit="times what independent pixels have",
        strengths=_MEANS,
        tolerance=1.2,
        holds_at=16.0,
        fails_at=None,
        why="A hash leaves no trace of how near its inputs were.",
        instead="This is the method to use.",
        source="[Jarzynski2020]; measured here",
    ),
    Row(
        name="strata-without-jitter",
        method="4 x 4 samples a pixel in the middle of their strata",
        stress="periods of a pattern in a pixel, the worst of whole numbers up to it",
        measure=partial(error_at_stripes, sampler="stratified", jitter=False),
        quantity="error",
        unit="relative RMSE",
        strengths=_PERIODS,
        tolerance=0.35,
        holds_at=2.0,
        fails_at=4.0,
        why="At 4, 8 and 12 periods all samples of a pixel meet the same place of the "
        "pattern: it is all white or all black, and no picture with as many samples shows "
        "the error. At other whole numbers nothing is wrong.",
        instead="Jitter, which makes noise of it.",
        source="[Dippe1985]; measured here",
        picture=stripes_seen,
        caption="4.1 periods a pixel, which should be grey: samples in the middle of their "
        "strata show a pattern that is not there, with jitter it is noise.",
    ),
    Row(
        name="strata-with-jitter",
        method="4 x 4 samples a pixel anywhere in their strata",
        stress="periods of a pattern in a pixel, the worst of whole numbers up to it",
        measure=partial(error_at_stripes, sampler="stratified"),
        quantity="error",
        unit="relative RMSE",
        strengths=_PERIODS,
        tolerance=0.35,
        holds_at=12.0,
        fails_at=None,
        why="A pattern finer than the strata leaves the noise of independent samples, "
        "one over the root of their number, and no more.",
        instead="This is the method to use.",
        source="[Dippe1985]; measured here",
    ),
    Row(
        name="independent-samples",
        method="16 independent samples a pixel",
        stress="periods of a pattern in a pixel, the worst of whole numbers up to it",
        measure=partial(error_at_stripes, sampler="independent"),
        quantity="error",
        unit="relative RMSE",
        strengths=_PERIODS,
        tolerance=0.35,
        holds_at=12.0,
        fails_at=None,
        why="Without strata there is nothing that a pattern could meet.",
        instead="Strata with jitter, which are never worse and mostly better.",
        source="measured here",
    ),
)

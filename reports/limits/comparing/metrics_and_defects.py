"""Which metric sees which defect through how much noise.

A metric sees a defect if it says more of it than it says between two right pictures that
differ in their noise alone. So each row measures the second over the first: near 1 the
metric is blind. The picture is rendered without noise; noise and defects are NumPy's.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.metrics import distances
from reports.limits.row import Row
from reports.limits.screen import on_screen

Picture = NDArray[np.float64]

SIZE = 64
DRAWS = 2  # pairs of noises that are averaged ...
DRAWS_OF_MEANS = 64  # ... where a metric is one small number that may be 0 by chance
EXTRA_NOISE = 0.05  # of the defect "noise", relative
FIREFLY = 100.0  # times the brightest pixel

_SCENE = f"""<scene version="3.0.0">
<integrator type="direct"/>
<sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="4,-4,3" target="0,0,0.4" up="0,0,1"/>
    </transform>
    <film type="hdrfilm"><integer name="width" value="{SIZE}"/>
        <integer name="height" value="{SIZE}"/><rfilter type="box"/></film>
    <sampler type="stratified"><integer name="sample_count" value="64"/></sampler></sensor>
<shape type="rectangle"><transform name="to_world"><scale value="3"/></transform>
    <bsdf type="diffuse"><texture type="checkerboard" name="reflectance">
        <transform name="to_uv"><scale value="5"/></transform></texture></bsdf></shape>
<shape type="sphere"><point name="center" value="0.5,0,1"/>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.7,0.3,0.2"/></bsdf></shape>
<emitter type="directional"><vector name="direction" value="-1,0.2,-2"/>
    <rgb name="irradiance" value="3"/></emitter>
<emitter type="point"><point name="position" value="-2,-3,2"/>
    <rgb name="intensity" value="3"/></emitter>
</scene>"""


@functools.cache
def right_picture() -> Picture:
    """Return the picture without noise, (64, 64, 3)."""
    return renderer.render(renderer.load_string(_SCENE)).pixels.astype(np.float64)


def noisy(picture: Picture, amount: float, random: np.random.Generator) -> Picture:
    """Return the picture with grey noise of this relative deviation, and the same mean."""
    if amount == 0.0:
        return picture
    shape = amount**-2.0
    factors = random.gamma(shape, 1.0 / shape, (*picture.shape[:2], 1))
    return np.asarray(picture * factors)


def shifted(picture: Picture, random: np.random.Generator) -> Picture:
    """Return the picture a pixel to the right, as a wrong film position makes it."""
    return np.roll(picture, 1, axis=1)


def brighter(picture: Picture, random: np.random.Generator) -> Picture:
    """Return the picture brighter by one per cent."""
    return picture * 1.01


def blurred(picture: Picture, random: np.random.Generator) -> Picture:
    """Return the means of 3 x 3 pixels, as a filter too wide makes them."""
    padded = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge")
    parts = (padded[y : y + SIZE, x : x + SIZE] for y in range(3) for x in range(3))
    return np.asarray(sum(parts) / 9.0)


def noisier(picture: Picture, random: np.random.Generator) -> Picture:
    """Return the picture with more noise, as a worse sampler makes it."""
    return noisy(picture, EXTRA_NOISE, random)


def with_firefly(picture: Picture, random: np.random.Generator) -> Picture:
    """Return the picture with one pixel far too bright."""
    struck = picture.copy()
    struck[SIZE // 4, SIZE // 4] = FIREFLY * picture.max()
    return struck


def mirrored(picture: Picture, random: np.random.Generator) -> Picture:
    """Return the picture with left and right exchanged."""
    return picture[:, ::-1]


def unlike(a: Picture, b: Picture) -> float:
    """Return 1 - SSIM."""
    return 1.0 - (distances.ssim(a, b) or 0.0)


def mean_off(a: Picture, b: Picture) -> float:
    """Return the difference of the means of the two pictures, relatively."""
    return abs(distances.mean_difference(a, b))


Metric = Callable[[Picture, Picture], float]
Defect = Callable[[Picture, np.random.Generator], Picture]


def hidden_share(noise: float, *, metric: Metric, defect: Defect) -> float:
    """Return what a metric says of noise alone, over what it says of noise and defect."""
    picture, random = right_picture(), np.random.default_rng(5)
    alone = with_defect = 0.0
    for _ in range(DRAWS_OF_MEANS if metric is mean_off else DRAWS):
        first, second, wrong = (noisy(picture, noise, random) for _ in range(3))
        alone += metric(second, first)
        # the film's noise comes first, what the defect does to a picture after it
        with_defect += metric(defect(wrong, random), first)
    return alone / with_defect


def defects_seen() -> NDArray[np.uint8]:
    """Show the right picture, and each defect of `_DEFECTS` in order."""
    right, random = right_picture(), np.random.default_rng(5)
    wrong = [make(right, random) for _, make, _ in _DEFECTS.values()]
    return on_screen([right, *wrong])


_NOISES = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
_METRICS: dict[str, tuple[str, Metric]] = {
    "rmse": ("RMSE", distances.rmse),
    "ssim": ("1 - SSIM", unlike),
    "flip": ("FLIP", distances.flip),
    "mean": ("Difference of the means", mean_off),
    "tiles": ("RMSE of the means of 8 x 8 pixels", distances.tile_rmse),
}
_DEFECTS: dict[str, tuple[str, Defect, str]] = {
    "shift": (
        "a shift by one pixel",
        shifted,
        "Registration of the two pictures, or comparing without noise.",
    ),
    "brightness": (
        "1 % of brightness",
        brighter,
        "The difference of the means, which averages the noise of all pixels.",
    ),
    "blur": (
        "a blur of 3 x 3 pixels",
        blurred,
        "SSIM or FLIP; the means of tiles do not see it sooner.",
    ),
    "noise": (
        "5 % more noise",
        noisier,
        "The variance between seeds, measured by itself.",
    ),
    "firefly": (
        "one pixel 100 times too bright",
        with_firefly,
        "RMSE, or the largest difference of a pixel.",
    ),
    "mirror": (
        "left and right exchanged",
        mirrored,
        "Any of them, once the noise is below the contrast of the picture.",
    ),
}


def _row(
    defect: str, metric: str, holds_at: float, fails_at: float | None, why: str
) -> Row:
    method, measure = _METRICS[metric]
    what, make, instead = _DEFECTS[defect]
    first = metric == "rmse" and defect == "shift"
    return Row(
        name=f"{metric}-{defect}",
        method=f"{method} against {what}",
        stress="noise of a pixel, relative (NumPy's)",
        measure=partial(hidden_share, metric=measure, defect=make),
        quantity="error",
        unit="of what it says is there without the defect",
        strengths=_NOISES,
        tolerance=0.8,
        holds_at=holds_at,
        fails_at=fails_at,
        why=why,
        instead=instead,
        source="measured here",
        picture=defects_seen if first else None,
        caption="The right picture, and what is done to it: shifted, brighter, blurred, "
        "noisier, with one bright pixel, mirrored."
        if first
        else "",
    )


ROWS = (
    _row("shift", "rmse", 0.1, 0.3, "Edges of the pattern are as strong as its squares."),
    _row("shift", "ssim", 0.1, 1.0, "It follows structure, which is out of place."),
    _row("shift", "flip", 0.3, 1.0, "It looks for edges and blurs the noise away."),
    _row("shift", "tiles", 0.3, 1.0, "The pattern's squares do not fit the tiles."),
    _row(
        "brightness",
        "rmse",
        0.003,
        0.03,
        "Squares of noise and offset add up: noise above 1 % outweighs 1 % of light.",
    ),
    _row(
        "brightness",
        "ssim",
        0.001,
        0.01,
        "It compares means of windows by their ratio, and a ratio of 1.01 is all but 1.",
    ),
    _row(
        "brightness",
        "flip",
        0.01,
        0.1,
        "It blurs as the eye does, which takes some of the noise and none of the offset.",
    ),
    _row(
        "brightness",
        "mean",
        0.1,
        1.0,
        "The noise of 4096 pixels averages out to a 64th of it.",
    ),
    _row(
        "brightness",
        "tiles",
        0.03,
        0.3,
        "The noise of 64 pixels averages out to an eighth of it.",
    ),
    _row(
        "blur",
        "rmse",
        0.03,
        0.3,
        "A blur takes noise away as well, so that RMSE falls where noise is strong.",
    ),
    _row("blur", "ssim", 0.1, 0.3, "Contrast within its windows is lost."),
    _row("blur", "flip", 0.1, 1.0, "Edges are lost, which it gives a term of their own."),
    _row("noise", "rmse", 0.03, 0.1, "Squares add up: 5 % beside 10 % is a quarter."),
    _row("noise", "ssim", 0.03, 0.1, "The same, once both noises hide the structure."),
    _row("noise", "flip", 0.01, 0.1, "It blurs noise of single pixels away."),
    _row("firefly", "rmse", 1.0, None, "One squared difference outweighs all others."),
    _row("firefly", "ssim", 0.03, 0.3, "One window in a few dozen is spoilt."),
    _row(
        "firefly",
        "flip",
        0.003,
        0.1,
        "An error of a pixel is 1 at the most, however bright, and the mean is taken.",
    ),
    _row("mirror", "rmse", 0.3, 1.0, "Noise as strong as the picture hides all of it."),
    _row("mirror", "ssim", 1.0, None, "Nothing of the structure is left."),
    _row("mirror", "flip", 1.0, None, "Colours and edges are elsewhere."),
)

"""Mistakes that need no further render: each makes a prediction from the reference.

A mistake is a function from the evidence to predictions, pictures that should look like the
one in question if it has the mistake. Parameters (a factor, an exponent, a shift) are
fitted. A free parameter can explain a little of any difference, so a fitted value is named
only where it is far from the one without the mistake.
"""

from __future__ import annotations

import itertools
import math
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, optimize

from renderer.rendering.picture.picture import srgb_from_linear
from renderer.scene_file.images.image import linear_from_srgb

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Evidence:
    """What a mistake is looked for in.

    Parameters
    ----------
    picture
        (H, W, 3); linear, unless the mistake is a transfer curve.
    reference
        The mean of the reference pictures without `aside`, with the filter of the picture;
        not cut off as integers are.
    scale
        (H, W, 1), brightness that differences are measured in.
    aovs
        Of the reference, one ray for each pixel: "depth", "shape_index", which is 0 where
        the ray meets nothing, ...
    shapes
        Names of the shapes by their index.
    aside
        The reference picture that only scales differences, see `set_aside`.
    levels
        The largest integer of the picture's file, which was decoded by the curve of sRGB; 0
        if it holds floating-point values.
    """

    picture: Floats
    reference: Floats
    scale: Floats
    aovs: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)
    shapes: Mapping[int, str] = field(default_factory=dict)
    aside: Floats | None = None
    levels: int = 0

    def as_kept(self, pixels: Floats) -> Floats:
        """Return linear values as the file of the picture keeps them."""
        return as_integers(pixels, self.levels) if self.levels else pixels


@dataclass(frozen=True)
class Prediction:
    """A picture that has a mistake.

    Parameters
    ----------
    name
        Short and fixed: programs compare it.
    sentence
        What is wrong.
    advice
        What to look at.
    pixels
        (H, W, 3).
    parameters
        How many numbers were fitted.
    """

    name: str
    sentence: str
    advice: str
    pixels: Floats
    parameters: int = 0


Mistake = Callable[[Evidence], Iterator[Prediction]]

TEXTS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def told(name: str, table: str = "", **values: Any) -> tuple[str, str, str]:
    """Return a mistake's name, and what image_mistakes.toml says of it.

    Parameters
    ----------
    name
        Of the mistake.
    table
        Header in the file where that is not the name.
    **values
        What the sentence is filled in with.
    """
    text = TEXTS[table or name]
    return name, text["sentence"].format(**values), text["advice"]


# factors that a missing or doubled constant makes, by what they are
FACTORS = {
    "pi": math.pi,
    "1/pi": 1.0 / math.pi,
    "2 pi": 2.0 * math.pi,
    "1/(2 pi)": 0.5 / math.pi,
    "4 pi": 4.0 * math.pi,
    "1/(4 pi)": 0.25 / math.pi,
    "2": 2.0,
    "1/2": 0.5,
    "4": 4.0,
    "1/4": 0.25,
    "3": 3.0,
    "1/3": 1.0 / 3.0,
}
NEAR = 0.02  # relative distance at which a fitted factor gets the name of a constant
FARTHEST = 8.0  # [pixels] a shift; farther ones fit what is no shift
TOLD = 0.003  # relative distance from 1 below which a factor is not reported


def fitted_factor(evidence: Evidence, where: Floats | float = 1.0) -> float:
    """Return the ratio of the sums of picture and reference, in units of the scale.

    Least squares would not do: noise in the reference raises the sum of its squares. With
    30 % of noise a factor of 2 became 1.84.
    """
    weight = where / evidence.scale
    below = float(np.sum(weight * evidence.reference))
    return float(np.sum(weight * evidence.picture)) / below if below > 0.0 else 1.0


def as_integers(pixels: Floats, levels: int) -> Floats:
    """Return linear values as a PNG keeps them: cut off at 1, and in `levels` steps."""
    steps = np.round(levels * srgb_from_linear(pixels)) / levels
    return np.asarray(linear_from_srgb(steps), np.float64)


def transfer_curves(evidence: Evidence) -> Iterator[Prediction]:
    """Predict a curve that was applied, or applied in the wrong direction."""
    r = np.maximum(evidence.reference, 0.0)
    if evidence.levels:
        yield from _curves_of_integers(r)
        return
    decoded = linear_from_srgb(np.minimum(r, 1.0)) + np.maximum(r - 1.0, 0.0)
    yield Prediction(*told("srgb-curve-applied"), srgb_from_linear(r))
    yield Prediction(*told("srgb-curve-inverted"), decoded)
    yield Prediction(*told("gamma-2.2-applied"), r ** (1.0 / 2.2))
    yield Prediction(*told("gamma-2.2-inverted"), r**2.2)
    yield Prediction(*told("tone-mapped"), r / (1.0 + r))


def _curves_of_integers(r: Floats) -> Iterator[Prediction]:
    """Predict a file of integers that was written with another curve than that of sRGB."""
    bright = np.minimum(r, 1.0)
    twice = srgb_from_linear(srgb_from_linear(bright))
    mapped = srgb_from_linear(r / (1.0 + r))
    for text, encoded in (
        (told("srgb-curve-missing"), bright),
        (told("gamma-2.2-instead-of-srgb"), bright ** (1.0 / 2.2)),
        (told("srgb-curve-applied-twice"), twice),
        (told("tone-mapped", "tone-mapped-in-integers"), mapped),
    ):
        yield Prediction(*text, linear_from_srgb(encoded))


def plain(evidence: Evidence) -> Iterator[Prediction]:
    """Predict a picture of one colour, or a black one."""
    colour = evidence.picture.mean(axis=(0, 1))
    if np.ptp(evidence.picture) == 0.0 and not colour.any():
        yield Prediction(*told("black"), np.zeros_like(evidence.reference))
    else:
        shown = ", ".join(f"{value:.3g}" for value in colour)
        pixels = np.broadcast_to(colour, evidence.reference.shape).copy()
        yield Prediction(*told("one-colour", colour=shown), pixels, 3)


def factors(evidence: Evidence) -> Iterator[Prediction]:
    """Predict one factor for all pixels, and one for each channel."""
    r = evidence.reference
    f = fitted_factor(evidence)
    named = [name for name, value in FACTORS.items() if abs(f / value - 1.0) < NEAR]
    if named and f > 0.0:
        text = told(f"factor-{named[0]}", "factor", constant=named[0], f=f)
        yield Prediction(*text, FACTORS[named[0]] * r)
    if abs(f - 1.0) > TOLD and f > 0.0:
        yield Prediction(*told("exposure", f=f, stops=math.log2(f)), f * r, 1)
    each = np.array([fitted_factor(evidence, one) for one in np.eye(3)])
    missing = [name for name, f in zip("RGB", each, strict=True) if abs(f) < 0.01]
    if 0 < len(missing) < 3:
        kept = np.array([0.0 if name in missing else 1.0 for name in "RGB"])
        yield Prediction(*told("missing-channel", names=" and ".join(missing)), kept * r)
    elif np.ptp(each) > TOLD:
        shown = ", ".join(f"{f:.4g}" for f in each)
        yield Prediction(*told("channel-factors", factors=shown), each * r, 3)


def channels(evidence: Evidence) -> Iterator[Prediction]:
    """Predict channels in another order, and grey values."""
    for order in itertools.permutations(range(3)):
        if order != (0, 1, 2):
            text = told("swapped-channels", order=", ".join("RGB"[c] for c in order))
            yield Prediction(*text, evidence.reference[..., list(order)])
    for weights, how in (((1 / 3, 1 / 3, 1 / 3), "mean"), ((0.2126, 0.7152, 0.0722), "Y")):
        grey = evidence.reference @ np.array(weights)
        pixels = np.repeat(grey[..., None], 3, axis=2)
        yield Prediction(*told("grey", how=how), pixels)


def orientations(evidence: Evidence) -> Iterator[Prediction]:
    """Predict mirrored, turned and transposed pictures."""
    r = evidence.reference
    turned = {
        "mirrored-left-right": r[:, ::-1],
        "mirrored-top-bottom": r[::-1],
        "rotated-180": r[::-1, ::-1],
    }
    if r.shape[0] == r.shape[1]:
        turned |= {
            "transposed": r.swapaxes(0, 1),
            "rotated-90": np.rot90(r),
            "rotated-270": np.rot90(r, 3),
        }
    for name, pixels in turned.items():
        yield Prediction(*told(name), np.ascontiguousarray(pixels))


def shifts(evidence: Evidence) -> Iterator[Prediction]:
    """Predict a picture that is shifted by up to some pixels."""

    def moved(by: Floats) -> Floats:
        return np.asarray(
            ndimage.shift(evidence.reference, (by[1], by[0], 0), order=1, mode="nearest")
        )

    def squares(by: Floats) -> float:
        return float(np.mean(((evidence.picture - moved(by)) / evidence.scale) ** 2))

    grid = [np.array([x, y]) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0)]
    found = optimize.minimize(
        squares, min(grid, key=squares), method="Nelder-Mead", options={"maxiter": 60}
    )
    x, y = (round(2.0 * float(part)) / 2.0 for part in found.x)
    if (x, y) == (0.0, 0.0) or max(abs(x), abs(y)) > FARTHEST:
        return
    half = "half-pixel-shift" if max(abs(x), abs(y)) == 0.5 else "shift"
    yield Prediction(*told(half, "shift", x=x, y=y), moved(np.array([x, y])))


def filters(evidence: Evidence) -> Iterator[Prediction]:
    """Predict a wider or a narrower reconstruction filter."""

    def squares(sigma: float, sharpen: bool) -> float:
        return float(
            np.mean(((evidence.picture - blurred(sigma, sharpen)) / evidence.scale) ** 2)
        )

    def blurred(sigma: float, sharpen: bool) -> Floats:
        smooth = ndimage.gaussian_filter(evidence.reference, (sigma, sigma, 0))
        return np.asarray(2.0 * evidence.reference - smooth if sharpen else smooth)

    for sharpen, name in ((False, "wider-filter"), (True, "narrower-filter")):
        found = optimize.minimize_scalar(
            squares, bounds=(0.05, 3.0), method="bounded", args=(sharpen,)
        )
        sigma = float(found.x)
        if sigma > 0.25:
            how = name.removesuffix("-filter")
            text = told(name, "other-filter", how=how, sigma=sigma)
            yield Prediction(*text, blurred(sigma, sharpen), 1)


def clamped(evidence: Evidence) -> Iterator[Prediction]:
    """Predict values that are cut off."""
    highest = float(np.max(evidence.picture))
    if 0.0 < highest < 0.98 * float(np.max(evidence.reference)):
        cut = np.minimum(evidence.reference, highest)
        yield Prediction(*told("clamped", highest=highest), cut, 1)
    if float(np.min(evidence.reference)) < 0.0 <= float(np.min(evidence.picture)):
        yield Prediction(*told("negative-cut-off"), np.maximum(evidence.reference, 0.0))


def background(evidence: Evidence) -> Iterator[Prediction]:
    """Predict a sky that is missing where a ray meets nothing."""
    shape = evidence.aovs.get("shape_index")
    if shape is None or not np.any(shape <= 0) or np.all(shape <= 0):
        return
    seen = (shape.reshape(shape.shape[:2]) > 0)[..., None]
    if float(np.abs(evidence.reference[~seen[..., 0]]).max()) > 0.0:
        dark = np.where(seen, evidence.reference, 0.0)
        yield Prediction(*told("no-background"), dark)


def materials(evidence: Evidence) -> Iterator[Prediction]:
    """Predict a factor on the pixels of one shape: a BSDF that loses or gains energy."""
    shape = evidence.aovs.get("shape_index")
    if shape is None:
        return
    index = shape.reshape(shape.shape[:2])
    for number in np.unique(index[index > 0]):
        where = (index == number)[..., None]
        if where.sum() < 16:
            continue
        f = fitted_factor(evidence, where)
        if abs(f - 1.0) > TOLD:
            name = evidence.shapes.get(int(number), f"number {int(number)}")
            pixels = np.where(where, f, 1.0) * evidence.reference
            yield Prediction(*told("material", shape=name, f=f), pixels, 1)


IMAGE_MISTAKES: tuple[Mistake, ...] = (
    plain,
    transfer_curves,
    factors,
    channels,
    orientations,
    shifts,
    filters,
    clamped,
    background,
    materials,
)

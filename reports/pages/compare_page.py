"""The page of `lightproof compare`: both pictures, what explains their difference."""

from __future__ import annotations

import base64
import io
import itertools
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mitsuba_ref.diagnosis.difference import FALSE_ALARMS
from mitsuba_ref.diagnosis.image_mistakes import Evidence, Floats
from mitsuba_ref.diagnosis.verdict import Comparison
from mitsuba_ref.metrics.distances import tile_means
from reports.look.pictures import (
    difference_colours,
    exposure_stops,
    signed_difference,
    symmetric_scale,
    tone_mapped,
)
from reports.look.template import fill

MOST_PLACES = 6  # shapes or parts of the picture in the table
SIDE = 4  # [pixels] of squares whose means show a difference through noise
PARTS = 4  # of a side of the picture, where no shapes are known
LARGEST_SIDE = 1280  # [pixels]: a larger picture is shown smaller, to keep the page small


@dataclass(frozen=True)
class Place:
    """A part of the picture: how many pixels it has, and how much it differs there."""

    name: str
    pixels: int
    ratio: float  # of the means; infinite where the reference is black
    share: float  # of the sum of absolute differences of 4 x 4 pixels


def compare_page(found: Comparison, command: Sequence[str]) -> str:
    """Return a self-contained page as HTML."""
    evidence = found.evidence
    evidence = replace(evidence, reference=evidence.as_kept(evidence.reference))
    stops = exposure_stops(evidence.reference.astype(np.float32))
    difference = signed_difference(_f32(evidence.picture), _f32(evidence.reference))
    named = found.named
    first = named[0].prediction if named else None
    left = (
        signed_difference(_f32(evidence.picture), _f32(evidence.as_kept(first.pixels)))
        if first
        else None
    )
    scale = symmetric_scale(difference)
    height, width = difference.shape

    def shown(pixels: Floats) -> str:
        return _png(tone_mapped(_f32(pixels), stops))

    return fill(
        "compare.html",
        found=found,
        named=named,
        command=shlex.join(command),
        width=width,
        height=height,
        stops=stops,
        scale=scale,
        mine=shown(evidence.picture),
        reference=shown(evidence.reference),
        predicted=shown(first.pixels) if first else "",
        difference=_png(difference_colours(difference, scale)),
        left="" if left is None else _png(difference_colours(left, scale)),
        places=places(evidence),
        false_alarms=FALSE_ALARMS,
    )


def places(evidence: Evidence) -> list[Place]:
    """Return where the pictures differ most: shapes if they are known, else parts."""
    index = evidence.aovs.get("shape_index")
    height, width = evidence.picture.shape[:2]
    if index is None:
        y, x = np.mgrid[0:height, 0:width]
        of = PARTS * (y * PARTS // height) + x * PARTS // width
        rows = ("top", "upper middle", "lower middle", "bottom")
        columns = ("left", "middle left", "middle right", "right")
        parts = itertools.product(rows, columns)
        names = {k: f"{row}, {column}" for k, (row, column) in enumerate(parts)}
    else:
        of = index.reshape(height, width).astype(np.int64)
        names = {k: f"shape {name}" for k, name in evidence.shapes.items()}
        names[0] = "the background"
    mine, theirs = (p.mean(axis=2) for p in (evidence.picture, evidence.reference))
    # noise cancels in a mean of neighbours, and a difference does not
    means = np.abs(tile_means((mine - theirs)[..., None], SIDE)[..., 0])
    strength = means.repeat(SIDE, axis=0).repeat(SIDE, axis=1)[:height, :width]
    whole = float(strength.sum()) or 1.0
    listed = []
    for number in np.unique(of):
        where = of == number
        below = float(theirs[where].sum())
        above = float(mine[where].sum())
        ratio = above / below if below else np.inf if above else 1.0
        name = names.get(int(number), f"shape number {int(number)}")
        share = float(strength[where].sum()) / whole
        listed.append(Place(name, int(where.sum()), ratio, share))
    return sorted(listed, key=lambda one: one.share, reverse=True)[:MOST_PLACES]


def _f32(pixels: Floats) -> NDArray[np.float32]:
    return pixels.astype(np.float32)


def _png(pixels: NDArray[np.uint8]) -> str:
    """Return bytes (H, W, 3) as a picture that a page holds."""
    stream = io.BytesIO()
    image = Image.fromarray(pixels)
    image.thumbnail((LARGEST_SIDE, LARGEST_SIDE), Image.Resampling.BOX)
    image.save(stream, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode("ascii")

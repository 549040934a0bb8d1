"""The page of what scenes need, needs.html."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from reports.look.pictures import (
    LUMINANCE,
    difference_uri,
    exposure_stops,
    picture_uri,
    symmetric_scale,
    tone_mapped,
)
from reports.look.template import fill
from reports.needs.record import Loss, NeedsRecord, SceneNeeds
from reports.needs.study import Study, mean_picture


@dataclass(frozen=True)
class Shown:
    """One scene on the page."""

    anchor: str
    title: str
    needs: SceneNeeds
    picture: str  # data URI of the full scene; "": it is not at hand
    pictures: list[Any]  # words, data URI, scale, loss: of each difference


def needs_page(record: NeedsRecord, studies: Sequence[Study | None] = ()) -> str:
    """Return the whole page as HTML; without studies, which no file holds, no pictures."""
    pairs = zip_longest(record.scenes, studies)
    shown = [
        _shown(f"scene-{n}", needs, study) for n, (needs, study) in enumerate(pairs, 1)
    ]
    filters: dict[str, Callable[..., str]] = {
        "percent": percent,
        "interval": interval,
        "fewer": fewer,
    }
    return fill("trials/needs.html", filters=filters, record=record, shown=shown)


def percent(value: float) -> str:
    """Return 0.0123 as 1.2 %, and what is exactly 0 as 0."""
    if value == 0.0:
        return "0"
    return f"{100.0 * value:.0f} %" if value > 0.99 else f"{100.0 * value:.2g} %"


def interval(value: float, half_width: float) -> str:
    """Return a value with its interval, in per cent."""
    if value == half_width == 0.0:
        return "0"
    if abs(value) + half_width < 1e-6:  # about the rounding of pictures
        return "below 0.0001 %"
    digits = max(0, min(4, 1 - int(np.floor(np.log10(max(100.0 * half_width, 1e-3))))))
    return f"{100.0 * value:+.{digits}f} ± {100.0 * half_width:.{digits}f} %"


def fewer(shared_variance: float | None) -> str:
    """Return how many times fewer seeds are needed because the numbers are shared."""
    if shared_variance is None:
        return "-"
    # below the rounding of pictures there is nothing to measure
    return f"{1.0 / shared_variance:,.3g}" if shared_variance > 1e-6 else "over 1e6"


def title_of(needs: SceneNeeds) -> str:
    """Return a scene's folder, or the name of its file."""
    path = Path(needs.scene)
    return path.parent.name if path.stem == "scene" and path.parent.name else path.stem


def _shown(anchor: str, needs: SceneNeeds, study: Study | None) -> Shown:
    if study is None:
        return Shown(anchor, title_of(needs), needs, "", [])
    full = mean_picture(study.full)
    losses: list[Loss] = [*needs.losses]
    if needs.least is not None and len(needs.least.words) > 1:
        losses.append(needs.least)
    pictures = []
    for loss in losses:
        words = " ".join(loss.words)
        difference = study.differences[words].astype(np.float64) @ LUMINANCE
        scale = symmetric_scale(difference)
        uri = difference_uri(difference, scale)
        pictures.append({"words": words, "uri": uri, "scale": scale, "loss": loss})
    uri = picture_uri(tone_mapped(full, exposure_stops(full)))
    return Shown(anchor, title_of(needs), needs, uri, pictures)

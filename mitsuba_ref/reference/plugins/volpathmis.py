"""Where Mitsuba's `volpathmis` is wrong in the mean (`known_faults.take_volpath`).

It weighs each path by the densities of two ways to find it. What changes one of them alone
leaves weights that do not add up to 1. A replay has the same weights on both sides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from renderer.plugins.bsdfs.registry import nested_names
from renderer.scene.materials import kind_of, sides
from renderer.scene.media_tables import media_of
from renderer.scene_file.description import (
    ConstantTexture,
    Integrator,
    SceneDescription,
    ThinDielectric,
)
from renderer.scene_file.media_description import GridVolume


@dataclass(frozen=True)
class WrongWeights:
    """A fault of `volpathmis`."""

    words: str
    there: Callable[[SceneDescription, Integrator], bool]  # whether a scene may show it


def _plays_roulette(description: SceneDescription, integrator: Integrator) -> bool:
    return integrator.max_depth < 0 or integrator.max_depth > integrator.rr_depth + 1


def _has_tinted_panes(description: SceneDescription, integrator: Integrator) -> bool:
    shown = [b for shape in description.every_shape for b in with_nested(shape.bsdf)]
    panes = [b.specular_transmittance for b in shown if isinstance(b, ThinDielectric)]
    tints = [b.transmittance for b in shown if b.plugin == "retarder"]
    panes += [tint.rgb if isinstance(tint, ConstantTexture) else tint for tint in tints]
    return any(b.plugin in ("polarizer", "circular") for b in shown) or any(
        np.shape(pane) != (3,) or np.min(pane) < 1.0 for pane in panes
    )


def _has_clear_lamps(description: SceneDescription, integrator: Integrator) -> bool:
    return any(
        side is not None and kind_of(side).straight
        for shape in description.shapes
        if shape.radiance is not None
        for side in sides(shape.bsdf)
    )


def with_nested(bsdf: Any) -> Iterator[Any]:
    """Yield a BSDF of a description and those inside of it."""
    yield bsdf
    for name in nested_names(bsdf):
        yield from with_nested(getattr(bsdf, name))


def _leaves_colours_out(description: SceneDescription, integrator: Integrator) -> bool:
    return any(
        medium.sigma_t.values.shape[3] > 1
        if isinstance(medium.sigma_t, GridVolume)
        else len(set(medium.sigma_t.rgb)) > 1
        for medium in media_of(description)
        if not medium.has_spectral_extinction
    )


def _takes_one_density(description: SceneDescription, integrator: Integrator) -> bool:
    return integrator.mis_densities == 1


OF_MEDIA = WrongWeights(
    "without has_spectral_extinction colours share one extinction", _leaves_colours_out
)
"""A fault of `volpath` too."""

FAULTS = (
    WrongWeights("Russian roulette counts for one of two ways to a light", _plays_roulette),
    WrongWeights("tinted panes count for one of two ways to a light", _has_tinted_panes),
    WrongWeights("lamps that light passes weigh what is behind them", _has_clear_lamps),
    OF_MEDIA,
    WrongWeights(
        "without use_spectral_mis a colour of 0 makes all of them 0", _takes_one_density
    ),
)


def faults_of(description: SceneDescription) -> str:
    """Return how `volpath` or `volpathmis` may be wrong in a scene; empty: not at all."""
    integrator = description.integrator.nested or description.integrator
    if integrator.name != "volpath":  # `volpathmis` is read as it, too
        return ""
    faults = FAULTS if integrator.mis_densities else (OF_MEDIA,)
    there = [fault.words for fault in faults if fault.there(description, integrator)]
    return ", and ".join(there)

"""Small lamps in fog, next to which light is looked for (`plugins.media.equiangular`)."""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import NDArray

from renderer.scene.light_tables import light_bounds
from renderer.scene.media_tables import media_of
from renderer.scene.scene import Scene
from renderer.scene_file.media_description import ConstantVolume, Medium

MOST_LAMPS = 16
"""Each costs time at each segment; of more none is looked for."""

_RADIUS = 1.0 / 16.0
"""Of a lamp, in lengths of the segments that light is looked for on, at most."""


def fog_lamps(scene: Scene) -> NDArray[np.float32]:
    """Return the table of `KernelScene.fog_lamps`, (5, lamps); (5, 0) for none."""
    table: NDArray[np.float32] = scene.once("fog lamps", _table, scene)
    return table


def _table(scene: Scene) -> NDArray[np.float32]:
    fogs = list(filter(_is_fog, media_of(scene.description)))
    bounds = [b for b in light_bounds(scene) if not b.at_infinity and b.strength > 0.0]
    if os.environ.get("FOG") is None: bounds = []
    if not fogs or not bounds:
        return np.zeros((5, 0), np.float32)
    sigma = min(fog.scale * float(np.mean(fog.sigma_t.rgb)) for fog in fogs)
    bounds = [b for b in bounds if b.radius <= float(os.environ["FOG"]) / sigma]
    if len(bounds) > MOST_LAMPS:
        bounds = []
    largest = max((b.strength for b in bounds), default=1.0)
    rows = [[*b.center, b.radius**2, b.strength / largest] for b in bounds]
    return np.array(rows, np.float32).reshape(-1, 5).T.copy()


def _is_fog(medium: Medium) -> bool:
    """Return whether a medium is the same everywhere, and scatters."""
    if medium.plugin != "homogeneous":
        return False
    dark = isinstance(medium.albedo, ConstantVolume) and not np.any(medium.albedo.rgb)
    return medium.scale * float(np.max(medium.sigma_t.rgb)) > 0.0 and not dark

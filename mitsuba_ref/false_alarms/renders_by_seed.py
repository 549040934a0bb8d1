"""One scene with many seeds by either renderer, without a cache.

The scene is loaded once, so that small pictures by the thousand are affordable.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.our_renderer.picture import edit_description
from mitsuba_ref.our_renderer.whole_picture import whole
from mitsuba_ref.reference.edited_scene import load_edited_scene
from mitsuba_ref.reference.variant import load_mitsuba, set_threads
from mitsuba_ref.statistics.convergence import Render

THREADS = 2
"""Of Mitsuba. Its random numbers follow from how many there are, ours do not."""


def by_mitsuba(
    path: Path, parameters: Mapping[str, str], independent: bool = False
) -> Render:
    """Return what renders a scene with Mitsuba, box filter: (H, W, 3) linear sRGB.

    Parameters
    ----------
    path
        Mitsuba 3 XML.
    parameters
        Values for the file's `$name`.
    independent
        The sampler `independent` in the place of the file's.
    """
    mi = load_mitsuba()
    set_threads(THREADS)
    scene = load_edited_scene(
        path, parameters, box_filter=True, independent_samples=independent
    ).scene

    def render(spp: int, seed: int) -> NDArray[np.float32]:
        return np.array(mi.render(scene, spp=spp, seed=seed), dtype=np.float32)[..., :3]

    return render


def by_ours(path: Path, parameters: Mapping[str, str], independent: bool = False) -> Render:
    """Return what renders a scene with our renderer; as `by_mitsuba`."""
    import renderer
    from renderer.scene.scene import build_scene
    from renderer.scene_file import read_file

    description = edit_description(
        read_file(path, **parameters),
        box_filter=True,
        first_hits=False,
        independent_samples=independent,
    )
    scene = build_scene(description)

    def render(spp: int, seed: int) -> NDArray[np.float32]:
        image = renderer.render(scene, spp=spp, seed=seed, ray_offset="mitsuba")
        return np.asarray(whole(image))

    return render

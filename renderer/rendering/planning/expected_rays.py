"""How many rays a render is likely to trace, which decides what building may cost."""

from __future__ import annotations

from renderer.accelerators.cost_model import RayCounts
from renderer.scene_file.description import Sensor

# Segments of a usual path: most leave the scene or end by roulette before any more.
_USUAL_DEPTH = 6


def expected_rays(
    camera: Sensor,
    spp: int,
    max_depth: int,
    lights: int,
    threads: int,
) -> RayCounts:
    """Estimate from the picture's size and the depth.

    Parameters
    ----------
    camera
        Whose film is rendered.
    spp
        Samples per pixel.
    max_depth
        Segments of a path; 1 where the first hit alone is looked at.
    lights
        Shadow rays of one point: 1, or all lights.
    threads
        That trace them.
    """
    paths = float(camera.film.crop_width * camera.film.crop_height * spp)
    if max_depth < 2:
        return RayCounts(paths, 0.0, threads)
    later = max(0, min(max_depth, _USUAL_DEPTH) - 2)
    return RayCounts(paths, paths * (lights + later * (1 + lights)), threads)

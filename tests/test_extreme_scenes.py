"""Scenes at the ends of what single precision can hold, and lights that look both ways.

Each was once a wrong picture: a black floor, a lamp that shone backwards, a box of
infinite size in the builder.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_scenes import diffuse, placed, rgb, sensor

import renderer


def _floor_under_the_sun(scale: float) -> renderer.Scene:
    """A floor of half width `scale` at z = 0, lit straight from above, seen from 3 up."""
    return renderer.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct"},
            "sensor": sensor((0, 0, 3), (0, 0, 0), up=(0, 1, 0)),
            "floor": {
                "type": "rectangle",
                "to_world": placed((0, 0, 0), (scale, 0, 0), (0, scale, 0)),
                "bsdf": diffuse(0.5),
            },
            "sun": {"type": "directional", "direction": [0, 0, -1], "irradiance": rgb(1)},
        }
    )


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e10, 1e17])
def test_floors_of_any_size_are_equally_bright(scale: float) -> None:
    """L = rho / pi E; the square of an area of 1e20 would leave float32 and give black."""
    pixels = renderer.render(_floor_under_the_sun(scale)).pixels
    if scale >= 1.0:  # the smallest is nowhere near the ray
        np.testing.assert_allclose(pixels, 0.5 / np.pi, rtol=1e-6)
    assert np.isfinite(pixels).all()


@pytest.mark.parametrize("scale", [1e18, 1e25, 1e38])
def test_floors_beyond_single_precision_are_refused(scale: float) -> None:
    with pytest.raises(renderer.SceneError, match="reach farther than 1e\\+18"):
        _floor_under_the_sun(scale)


def test_a_disk_whose_square_overflows_is_refused() -> None:
    """Its box would be infinite, and the builder's bins would not hold it."""
    disk = {"type": "disk", "to_world": np.diag([2e19, 2e19, 1.0, 1.0])}
    with pytest.raises(renderer.SceneError, match="disks reach farther"):
        renderer.load_dict(
            {"type": "scene", "sensor": sensor((0, 3, 0), (0, 0, 0)), "d": disk}
        )


LAMP = """v -1 -1 2
v 1 -1 2
v 0 1 2
vn 0.95 0 {}0.312
f 1//1 3//1 2//1
"""


@pytest.mark.parametrize("bsdf_samples", [0, 1])
@pytest.mark.parametrize(("sign", "lit"), [("-", True), ("", False)])
def test_shading_normals_decide_which_side_of_a_lamp_shines(
    tmp_path: Path, bsdf_samples: int, sign: str, lit: bool
) -> None:
    """Light samples and arriving paths agree: the floor is lit only if vn looks at it.

    The lamp is level, 2 above the floor, and its geometric normal points down; vertex
    normals (0.95, 0, -+0.312) look to +x. Lit: a spot at x = 1.5 under a lamp that looks
    down a little. Not lit: a spot at x = -1.5 under one that looks up a little.
    """
    side = 1 if lit else -1
    path = tmp_path / "lamp.obj"
    path.write_text(LAMP.format(sign))
    scene = renderer.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct", "bsdf_samples": bsdf_samples},
            "sensor": sensor((4 * side, 0, 1.5), (1.5 * side, 0, 0), spp=256, jitter=True),
            "floor": {
                "type": "rectangle",
                "to_world": placed((0, 0, 0), (9, 0, 0), (0, 9, 0)),
                "bsdf": diffuse(0.5),
            },
            "lamp": {
                "type": "obj",
                "filename": str(path),
                "emitter": {"type": "area", "radiance": rgb(1)},
            },
        }
    )
    mean = float(renderer.render(scene).pixels.mean())
    assert (mean > 1e-3) if lit else (mean == 0.0)

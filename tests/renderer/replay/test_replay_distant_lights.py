"""Where shadow rays to lights at infinity end in a replay: it changes their direction."""

import numpy as np
import pytest
from light_probes import LightProbe

mi = pytest.importorskip("mitsuba")
mi.set_variant("scalar_rgb")
BALL = {"type": "sphere", "radius": 0.5, "center": [1.0, 2.0, 0.5]}
BOX = {"type": "cube", "to_world": mi.ScalarTransform4f().scale([3.0, 1.0, 2.0])}
LAMP = {"type": "area", "radiance": {"type": "rgb", "value": [1.0, 1.0, 1.0]}}
FLAGS = mi.EmitterFlags.Infinite | mi.EmitterFlags.DeltaDirection
TEXELS = np.full((4, 8, 3), 0.5, np.float32)
LIGHTS = {
    "constant": lambda _: {"type": "constant"},
    "directional": lambda _: {"type": "directional", "direction": [0.3, -0.2, -1.0]},
    "envmap": lambda of: {"type": "envmap", "bitmap": of.Bitmap(TEXELS)},
    "sunsky": lambda _: {"type": "sunsky", "sun_direction": [0.2, 0.1, 0.8]},
}


@pytest.mark.parametrize("kind", list(LIGHTS))
def test_light_samples_end_where_mitsubas_end(kind):
    """Two radii of the sphere around the scene away, farther from points outside of it.

    A direction from the offset origin of a shadow ray differs by the offset over this
    length: 1e-5, where rounding is 1e-7.
    """
    light = LIGHTS[kind](mi)
    ours = LightProbe({"ball": BALL, "box": BOX}, {"sky": light}, (1.0,) * 3, replay=True)
    scene = mi.load_dict(
        {"type": "scene", "sky": light}
        | {f"{k}": shape | {"emitter": LAMP} for k, shape in enumerate((BALL, BOX))}
    )
    (sky,) = (e for e in scene.emitters() if mi.has_flag(e.flags(), FLAGS))
    rng = np.random.default_rng(3)
    position = np.float32(rng.uniform(-10.0, 10.0, (64, 3)) * ([[0.1], [1.0]] * 32))
    at, expected = mi.Interaction3f(), []
    for p in position.tolist():
        at.p = p
        expected.append(sky.sample_direction(at, mi.Point2f(0.3, 0.6))[0].dist)
    assert min(expected) < 0.8 * max(expected)  # inside and outside
    random = np.full((3, 64), np.float32([[0.3], [0.6], [0.5]]))
    drawn = ours.sample("sky", position, random)
    # our bounding boxes are wider by a few units in the last place
    np.testing.assert_allclose(drawn.distance, expected, rtol=5e-6)

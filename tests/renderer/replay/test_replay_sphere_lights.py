"""Points on sphere lights in a replay: cones around 1.5 degrees, and wide ones."""

import numpy as np
import pytest
from light_probes import LightProbe

mi = pytest.importorskip("mitsuba")
mi.set_variant("scalar_rgb")
N = 1000
CENTER = (1.0, 2.0, 0.5)
CONES = {  # range of the sine, most that a replay is off, least that our own way is
    "around 1.5 degrees": ((0.021, 0.042), 1.5e-6, 5e-6),
    "wide": ((0.1, 0.5), 4e-6, 2e-6),
}


@pytest.mark.parametrize("radius", [0.05, 0.8])
@pytest.mark.parametrize("cone", list(CONES))
def test_samples_are_mitsubas(radius, cone):
    """Directions to rounding, densities to the bit, where the own ones differ visibly."""
    sines, replay_within, own_beyond = CONES[cone]
    ball = {"type": "sphere", "radius": radius, "center": list(CENTER)}
    shape = mi.load_dict(ball | {"emitter": {"type": "area"}})
    rng = np.random.default_rng(2)
    away = rng.normal(size=(N, 3))
    sine = rng.uniform(*sines, (N, 1))
    away *= radius / sine / np.linalg.norm(away, axis=1, keepdims=True)
    position, random = np.float32(CENTER + away), rng.random((3, N), np.float32)
    random[0] = np.minimum(random[0], 0.99)  # at the rim of the cap rounding decides
    at, wi, pdf = mi.Interaction3f(), [], []
    for p, (x, y, _) in zip(position.tolist(), random.T.tolist(), strict=True):
        at.p = p
        ds = shape.sample_direction(at, mi.Point2f(x, y))
        wi.append(np.array(ds.d))
        pdf.append(ds.pdf)
    apart = {}
    for replay in (True, False):
        probe = LightProbe({"ball": ball}, {}, (1.0, 1.0, 1.0), replay=replay)
        drawn = probe.sample("ball", position, random)
        apart[replay] = np.linalg.norm(drawn.wi - wi, axis=1)
        if replay:
            np.testing.assert_allclose(drawn.pdf, pdf, rtol=3e-7)
    assert apart[True].max() < replay_within
    assert apart[False].max() > own_beyond

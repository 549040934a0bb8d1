"""Energy of the BSDFs, at the stage that renders, angle by angle.

Scattering returns a weight (BSDF x cosine / density). Its mean over samples is the albedo
at that angle of incidence: never above 1, and exactly 1 for surfaces that absorb nothing.
Most weights have no noise; where there is a choice, the test states what it finds.
"""

from __future__ import annotations

import numpy as np
import pytest
from chi_square import FALSE_ALARM, binomial_found, binomial_p_value
from scatter_probes import (
    ScatterProbe,
    clear_glass,
    dielectric64,
    seen_at,
    undone,
)
from small_scenes import pixels, sensor, white_furnace

ANGLES = np.array([0, 10, 30, 41.7, 42, 45, 60, 75, 85, 89, 89.9])
ROUNDING = 2.0**-24  # half a unit in the last place of 1


def rgb(values):
    return {"type": "rgb", "value": list(values)}


both_sides = pytest.mark.parametrize("side", [1, -1], ids=["front", "back"])


# ------------------------------------------------------------------------------ energy


@both_sides
def test_tinted_glass_weighs_by_what_it_reflects_and_transmits(side):
    """The mean over samples is r R + t (1 - R), with the same R as the two rays' weights.

    The number of reflected rays among 2048 at each angle is binomial: 1e-5 for all angles;
    a mean off by 8 % of |r - t| is found with 99 %. The two rays' weights have no noise.
    """
    r, t = np.array([0.9, 0.5, 0.1]), np.array([0.3, 0.6, 1.0])
    tinted = clear_glass(specular_reflectance=rgb(r), specular_transmittance=rgb(t))
    wo = seen_at(ANGLES, side)
    mean = undone(tinted.scatter(wo, samples=2048)).mean(axis=0)
    cosine = np.abs(wo[:, 2])
    reflectance = dielectric64(cosine, 1.5 if side > 0 else 1 / 1.5)
    reflected = (mean - t) / (r - t)  # of each colour the same share
    np.testing.assert_allclose(reflected, reflected[:, :1] * [1, 1, 1], atol=2e-5)
    expected = np.clip(reflectance, 0, 1)
    counts = np.rint(reflected[:, 0] * 2048).astype(int)
    false_alarm = FALSE_ALARM / len(ANGLES)
    for count, p in zip(counts.tolist(), expected.tolist(), strict=True):
        assert binomial_found(p, 2048, false_alarm) < 0.08
        assert binomial_p_value(count, 2048, p) > false_alarm
    rays = [np.nan_to_num(undone(part)[0]) for part in tinted.split(wo)]
    both = r * expected[:, None] + t * (1 - expected[:, None])
    np.testing.assert_allclose(sum(rays), both, atol=1e-5)


def test_roulette_keeps_the_mean():
    """A path that survives (60 %) weighs 1 / 0.6 as much; of a white mirror 95 % survive.

    2^18 paths each: a mean that is off by 1.1 % (0.32 % of the white one) is found with
    99 %; false alarm rate 1e-5 each.
    """
    for value, survive, finds in ((0.6, 0.6, 0.0066), (1.0, 0.95, 0.003)):
        bsdf = {"type": "conductor", "material": "none"}
        bsdf["specular_reflectance"] = rgb([value] * 3)
        probe = ScatterProbe({"type": "twosided", "bsdf": bsdf}, roulette=True)
        out = probe.scatter(np.tile(seen_at(60), (1024, 1)), samples=256)
        alive = np.isfinite(out.eta)
        np.testing.assert_allclose(out.weight[alive], value / survive, rtol=4 * ROUNDING)
        assert binomial_found(survive, alive.size) < finds
        assert binomial_p_value(alive.sum(), alive.size, survive) > FALSE_ALARM


# --------------------------------------------------------------- the whole renderer


@pytest.mark.parametrize("degrees", [0, 30, 60, 80, 89])
@pytest.mark.parametrize("ball", [0, 1, 2], ids=["diffuse", "mirror", "glass"])
def test_white_furnace_at_an_angle(ball, degrees):
    """A white ball under an even sky, one ray at an angle of incidence: L = 1.

    Without noise, as BSDF samples alone find the sky; the diffuse ball by light samples
    too, within 5 standard errors, which are below 0.2 %: 1.5 % of energy lost or made at
    an angle is found with 99 %, at a false alarm rate of 6e-7.
    """
    content = white_furnace()
    center, offset = 2.5 * (ball - 1), np.sin(np.radians(degrees))
    content["sensor"] = sensor((center, -8, offset), (center, 0, offset))
    assert pixels(content) == pytest.approx(1, rel=2e-5)
    if ball > 0:
        return
    film = {"size": (32, 32), "spp": 16, "jitter": True}
    content["sensor"] = sensor((center, -8, offset), (center, 0, offset), **film)
    values = pixels(content, light_choice="uniform")
    error = values.std() / 32
    assert error < 0.002
    assert abs(values.mean() - 1) < 5 * error

"""Reciprocity of the BSDFs, and Fresnel's equations to the last bits.

Helmholtz: light and eye may change places. Asked at the stage that renders; nothing here is
random. Rounding is counted in units of 2^-24, half a unit in the last place of 1.
"""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import directions
from scatter_probes import (
    clear_glass,
    diffuse_f_cos,
    seen_at,
    two_sided,
    undone,
)
from test_bsdfs import dielectric64, fresnel

ROUNDING = 2.0**-24
ALBEDO = (0.25, 0.5, 0.75)
both_sides = pytest.mark.parametrize("side", [1, -1], ids=["front", "back"])


def rgb(values):
    return {"type": "rgb", "value": list(values)}


# --------------------------------------------------------------------------- reciprocity


def test_diffuse_reflection_is_reciprocal():
    """f(wi, wo) = f(wo, wi) for all pairs above the surface; nothing from below."""
    rng = np.random.default_rng(1)
    wi, wo = (np.abs(directions(4096, rng)[:, 2]) for _ in range(2))
    # f cos is what is stated; f is that over the cosine of the direction it came from
    there, back = diffuse_f_cos(ALBEDO, wi) / wi, diffuse_f_cos(ALBEDO, wo) / wo
    np.testing.assert_allclose(there, back, rtol=6 * ROUNDING)
    np.testing.assert_array_equal(diffuse_f_cos(ALBEDO, -wi), 0)


@both_sides
def test_a_mirror_is_reciprocal(side):
    """From the mirrored direction the same share goes back to where it came from."""
    metal = two_sided(type="conductor", eta=rgb((0.2, 1.1, 3.2)), k=rgb((3.9, 2.6, 3.3)))
    wo = seen_at(np.linspace(0, 89.9, 1000), side)
    there = metal.scatter(wo)
    back = metal.scatter(there.direction[0])
    np.testing.assert_allclose(back.direction[0], wo, atol=8 * ROUNDING)
    np.testing.assert_allclose(back.weight, there.weight, rtol=8 * ROUNDING)


@both_sides
def test_glass_is_reciprocal(side):
    """R(theta_i) = R(theta_t) from the other side, and radiance over eta^2 both ways.

    The weights of the refracted ray there and back, w and w', hold
    w eta^2 = w' / eta^2 = 1 - R. Rounding grows towards grazing incidence.
    """
    probe = clear_glass()
    degrees = np.linspace(0.1, 89.9 if side > 0 else 41.7, 200)
    wo = seen_at(degrees, side)
    reflected, refracted = probe.split(wo)
    behind, back = probe.split(refracted.direction[0])
    assert np.sign(refracted.direction[0, :, 2] * wo[:, 2]).max() == -1
    # squared, as a grazing direction's cosine is the root of a difference
    got = back.direction[0].astype(float)
    np.testing.assert_allclose(got[:, 0], wo[:, 0], atol=8 * ROUNDING)
    np.testing.assert_allclose(got[:, 2] ** 2, wo[:, 2] ** 2, atol=8 * ROUNDING)
    assert (got[:, 2] * wo[:, 2] > 0).all()
    # weights of the reflected rays are R; what is lost on the way is regained. R falls by
    # at most 6 for 1 of the cosine outside, which is known to 2^-24 over itself
    slant = np.minimum(np.abs(wo[:, 2]), np.abs(refracted.direction[0, :, 2]))
    bound = 16 * ROUNDING * (1 + 1 / slant)
    for here, there in ((behind, reflected), (back, refracted)):
        error = np.abs(undone(here) - undone(there))[0].max(axis=-1)
        assert (error < bound).all()
    np.testing.assert_allclose(back.eta * refracted.eta.astype(float), 1, rtol=4 * ROUNDING)


# ------------------------------------------------------------------------------ Fresnel

INDICES = (1.0003, 1.01, 1.1, 1.333, 1.5, 1.5046, 2.4, 3.5, 0.999, 0.9, 2 / 3, 0.5)
COSINES = np.concatenate((np.linspace(0, 1, 4001), 10 ** np.linspace(-8, 0, 1001)))


@both_sides
@pytest.mark.parametrize("index", INDICES)
def test_glass_reflects_as_complex_numbers_say_to_the_last_bits(index, side):
    """Mixed error bound: right to 6 roundings for inputs that are wrong by 2 roundings.

    The reflectance lies, up to 6 x 2^-24 of itself, within the range that the exact formula
    takes when cosine and index change by 2 x 2^-24 of themselves (measured: 4.6). A plain
    bound would be useless at the critical angle, where the curve is a root; thousands of
    cosines there are part of the grid.
    """
    index = np.float32(index)
    ratio = float(index) if side > 0 else 1 / float(index)
    critical = np.sqrt(max(1 - ratio**2, 0.0))
    steps = np.concatenate((np.linspace(-1e-3, 1e-3, 2001), np.linspace(-1e-6, 1e-6, 201)))
    cosine = np.unique(np.float32(np.append(COSINES, critical * (1 + steps))))
    got = fresnel(side * cosine, index)[0]
    wide = cosine.astype(float)
    near = [
        dielectric64(wide * (1 + i * ROUNDING), ratio * (1 + j * ROUNDING))
        for i in (-2, 0, 2)
        for j in (-2, 0, 2)
    ]
    low, high = np.min(near, axis=0), np.max(near, axis=0)
    assert (got >= low * (1 - 6 * ROUNDING)).all()
    assert (got <= high * (1 + 6 * ROUNDING)).all()


METALS = [(0.2, 3.9), (1.1, 2.6), (3.2, 3.3), (1.5, 0), (0.05, 6), (2.9, 0.01), (0.143, 4)]


@pytest.mark.parametrize(("eta", "k"), METALS)
def test_metals_reflect_as_complex_numbers_say(eta, k):
    """Within 64 x 2^-24 = 3.8e-6 on a fine grid (measured: 44, for eta 0.05, k 6)."""
    cosine, eta, k = np.float32(COSINES), np.float32(eta), np.float32(k)
    got = fresnel(cosine, eta, k)[3]
    expected = dielectric64(cosine.astype(float), float(eta) + 1j * float(k))
    np.testing.assert_allclose(got, expected, rtol=0, atol=64 * ROUNDING)


def test_the_formula_in_float64():
    """Against the table of ground truths (row M), Brewster's angle among it."""
    degrees = np.array([0, 45, np.degrees(np.arctan(1.5)), 60, 80, 85])
    known = [0.04, 0.0502399, 0.0739645, 0.0891867, 0.3877044, 0.6127996]
    got = dielectric64(np.cos(np.radians(degrees)), 1.5)
    np.testing.assert_allclose(got, known, rtol=2e-6)

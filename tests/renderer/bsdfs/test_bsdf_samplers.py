"""Chi-square tests of the warps and of the BSDFs: directions against their density.

A warp gets 2^20 random points; a BSDF is sampled at the stage that renders (`scatter`),
with the renderer's own random numbers, 1024 times at each of 1024 points. Each comparison
has a false alarm rate of 1e-5 and asserts that it finds a density tilted by 3 % from one
end to the other with a power of 99 % (tests/probes/chi_square.py). All 14 comparisons here
fail with a chance of 1.4e-4 for a right renderer; the seeds are fixed.
"""

from __future__ import annotations

import numpy as np
import pytest
from chi_square import (
    FALSE_ALARM,
    assert_follows,
    binomial_found,
    binomial_p_value,
    cell_masses,
    histogram,
)
from kernel_probes import unit
from scatter_probes import clear_glass, dielectric64, diffuse_pdf, two_sided

from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.memory import load_row
from renderer.kernels.lanes.vectors import store3, vec3
from renderer.plugins.lights.constant import SPHERE_PDF
from renderer.plugins.sampling.numbers_and_warps import (
    square_to_cosine_hemisphere,
    square_to_disk,
    square_to_sphere,
)

N = 1 << 20
FINDS = 0.03
SIXTEEN = np.linspace(0, 1, 17)
TURN = 2 * np.pi * SIXTEEN


@entry_kernel
def run_warps(x, y, disk, hemisphere, sphere):
    for i in range(0, x.size, 16):
        a, b = load_row(x, 0, i), load_row(y, 0, i)
        p, q = square_to_disk(a, b)
        store3(disk, i, vec3(p, q, 0.0))
        store3(hemisphere, i, square_to_cosine_hemisphere(a, b))
        store3(sphere, i, square_to_sphere(a, b))


def stated_pdf(cosine, _angle):
    """The diffuse BSDF's density [1/sr]; per unit of cosine and of angle."""
    return diffuse_pdf(cosine)


def angle(y, x):
    return np.arctan2(y, x) % (2 * np.pi)


# -------------------------------------------------------------------------------- warps


@pytest.fixture(scope="module")
def warps():
    """Disk, hemisphere, sphere: each (3, N)."""
    x, y = np.random.default_rng(11).random((2, N), np.float32)
    out = [np.empty((3, N), np.float32) for _ in range(3)]
    run_warps(x, y, *out)
    return [a.astype(float) for a in out]


def test_square_to_disk(warps):
    """1 / pi per area: r / pi per unit of radius and angle."""
    x, y, _ = warps[0]
    masses = cell_masses(lambda r, _: r / np.pi, SIXTEEN, TURN)
    radius = np.minimum(np.hypot(x, y), 1)  # rounded beyond by 1e-7
    counts = histogram(radius, angle(y, x), SIXTEEN, TURN)
    assert_follows(counts, masses, N, finds=FINDS)


def test_square_to_cosine_hemisphere(warps):
    """The density that the diffuse BSDF states."""
    x, y, z = warps[1]
    masses = cell_masses(stated_pdf, SIXTEEN, TURN)
    assert_follows(histogram(z, angle(y, x), SIXTEEN, TURN), masses, N, finds=FINDS)


def test_square_to_sphere(warps):
    """The density that the environment states, 1 / (4 pi)."""
    x, y, z = warps[2]
    edges = 2 * SIXTEEN - 1
    masses = cell_masses(lambda a, b: float(SPHERE_PDF) + 0 * a, edges, TURN)
    assert_follows(histogram(z, angle(y, x), edges, TURN), masses, N, finds=FINDS)


# ------------------------------------------------------------------------------ diffuse


@pytest.fixture(scope="module")
def white():
    white = {"type": "rgb", "value": 1.0}
    return two_sided(type="diffuse", reflectance=white)


def frame(normal):
    n = unit(normal)
    s = unit(np.cross(n, np.eye(3)[np.abs(n).argmin()]))
    return s, np.cross(n, s), n


def around(normal, degrees):
    """Directions (1024, 3) at an angle to the normal, all around it."""
    s, t, n = frame(normal)
    turn = np.linspace(0, 2 * np.pi, 1024, endpoint=False)[:, None]
    theta = np.radians(degrees)
    return np.cos(theta) * n + np.sin(theta) * (np.cos(turn) * s + np.sin(turn) * t)


@pytest.mark.parametrize(
    ("normal", "degrees"),
    [
        ((0, 0, 1), 0),
        ((0, 0, 1), 89.9),
        ((0, 0, 1), 180),
        ((1e-4, 0, -1), 60),
        ((1e-4, 0, -1), 100),
        ((1, 2, 3), 45),
        ((1, 2, 3), 90.1),
        ((-1, 0, 1e-4), 80),
    ],
)
def test_diffuse_reflection(white, normal, degrees):
    """Tilted normals, both sides, any angle of incidence: cos / pi on the side of wo.

    Near the horizon the cells are finer: cosines below 0.1, 1 % of the samples, have eight
    of the 23 rows; 20 % too many or too few there are found.
    """
    wo = around(normal, degrees)
    out = white.scatter(wo, normal=unit(normal), samples=1024, seed=degrees)
    s, t, n = frame(normal) if degrees < 90 else frame(np.negative(normal))
    wi = unit(out.direction.reshape(-1, 3))
    edges = np.append(np.linspace(0, 0.1, 9), SIXTEEN[2:])
    cosine = np.clip(wi @ n, 0, 1)
    masses = cell_masses(stated_pdf, edges, TURN)
    counts = histogram(cosine, angle(wi @ t, wi @ s), edges, TURN)
    # a path ends where the cosine is 0, as it is for one number in 10^7
    outcome = assert_follows(counts, masses, N, finds=FINDS, stray=2)
    near_horizon = np.broadcast_to((edges[:-1] < 0.0999)[:, None], counts.shape)
    assert outcome.detectable(near_horizon) < 0.2
    alive = np.isfinite(cosine)
    np.testing.assert_allclose(out.pdf.ravel()[alive], cosine[alive] / np.pi, atol=3e-7)


# --------------------------------------------------------------------------- dielectric


ANGLES = (0, 15, 30, 38, 41, 41.7, 41.9, 45, 50, 60, 70, 75, 80, 85, 88, 89.9)


@pytest.mark.parametrize("inside", [False, True], ids=["outside", "inside"])
def test_glass_chooses_by_fresnel_s_reflectance(inside):
    """How often a ray is reflected, at 16 angles, by the two-sided binomial test.

    131,072 rays an angle, 1e-5 for all 16: with 99 % power a probability is found that is
    off by 0.011, and by 0.005 at normal incidence, where it is 0.04 (Schlick's
    approximation is off by 0.008 at 45 degrees). From inside, beyond 41.81 degrees, not
    one ray may leave.
    """
    glass = clear_glass()
    theta = np.radians(np.repeat(ANGLES, 1024 // len(ANGLES)))
    cosine = np.cos(theta) * (-1 if inside else 1)
    wo = np.stack((np.sin(theta), 0 * theta, cosine), axis=1)
    out = glass.scatter(wo, samples=2048)
    same_side = np.sign(out.direction[..., 2]) == np.sign(cosine)
    reflected = same_side.reshape(2048, len(ANGLES), -1).sum(axis=(0, 2))
    samples = same_side.size // len(ANGLES)
    false_alarm = FALSE_ALARM / len(ANGLES)
    for k, degrees in enumerate(ANGLES):
        # the cosine as the kernel gets it
        c = float(np.float32(np.abs(cosine[k * 1024 // len(ANGLES)])))
        expected = float(dielectric64(c, 1 / 1.5 if inside else 1.5))
        if inside and degrees > 41.82:
            assert expected == pytest.approx(1, abs=1e-12)
            assert reflected[k] == samples
            continue
        assert binomial_found(expected, samples, false_alarm) < 0.011
        assert expected > 0.05 or binomial_found(expected, samples, false_alarm) < 0.005
        p_value = binomial_p_value(reflected[k], samples, expected)
        assert p_value > false_alarm, (degrees, reflected[k] / samples, expected)


# --------------------------------------------------------------------------------- film


def test_film_positions_are_uniform_in_their_pixel(white):
    """2^20 positions of 1024 pixels, within the pixel that they belong to."""
    x, y = white.film_positions(1024)
    slot_x, slot_y = np.floor(x[0]), np.floor(y[0])
    np.testing.assert_array_equal(np.sort(slot_y * 32 + slot_x), np.arange(1024))
    dx, dy = x - slot_x, y - slot_y
    masses = np.full((16, 16), 1 / 256)
    # what rounds up to the next pixel's edge, 6e-8 of them, lies on the last edge
    counts = histogram(dx.ravel(), dy.ravel(), SIXTEEN, SIXTEEN)
    assert_follows(counts, masses, N, finds=FINDS)

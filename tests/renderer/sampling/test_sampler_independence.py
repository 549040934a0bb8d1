"""Random numbers: uniform, and independent of neighbours, other dimensions and other seeds.

Row 27 of the project's list of failure modes. Numbers are drawn for a picture of 512 x 512
pixels. What its noise must not have is found at all distances at once: the correlation of
two pictures at every shift, by Fourier transform. Each comparison has a false alarm rate of
1e-5, Sidak's limit over the shifts; a correlation of 0.018 at any one shift is found with
99 %. Histograms of pairs find a tilt of 4 % in either. All 146 comparisons of right
samplers fail with a chance of 1.5e-3; the seeds are fixed.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from chi_square import FALSE_ALARM, assert_follows, histogram, sidak
from sampler_probes import draw, label, samplers
from scipy import stats
from small_scenes import sensor, white_furnace

import renderer
from renderer.plugins.sampling.numbers_and_warps import Independent
from renderer.plugins.sampling.sobol import make_sobol

SIDE = 512
N = SIDE**2
PIXELS = np.arange(N)
SAMPLERS = [Independent(7), *samplers(8, 8), *samplers(5, 3), make_sobol(7, 64)]
every_sampler = pytest.mark.parametrize("sampler", SAMPLERS, ids=label)


def pictures(sampler, *, sample=3, block=1):
    """Four numbers of each pixel: (4, 512, 512) with mean 0 and variance 1."""
    numbers = draw(sampler, PIXELS, sample, block).reshape(4, SIDE, SIDE)
    return (numbers - 0.5) * np.sqrt(12)


def correlations(a, b):
    """The correlation of two pictures at every shift (circular), in standard errors."""
    product = np.fft.rfft2(a) * np.conj(np.fft.rfft2(b))
    return np.fft.irfft2(product, s=a.shape) / SIDE


def limit(comparisons):
    return stats.norm.isf(sidak(FALSE_ALARM, comparisons) / 2)


def test_what_a_picture_of_correlations_finds():
    """Pictures that correlate by 0.018 with another 3 pixels on: 99 of 100.

    The limit for 2^18 shifts is 6.6 standard errors, 0.0129. Of 40 pictures without it,
    none is an alarm; fewer than 36 of 40 found would be chance in 1 of 10^4 such tests.
    """
    rng = np.random.default_rng(5)
    z = limit(N)
    assert (z + stats.norm.isf(0.01)) / SIDE < 0.018
    found = 0
    for _ in range(40):
        noise = rng.standard_normal((SIDE, SIDE))
        other = rng.standard_normal((SIDE, SIDE))
        assert np.abs(correlations(noise, other)).max() < z
        related = 0.018 * np.roll(noise, 3, axis=1) + np.sqrt(1 - 0.018**2) * other
        found += np.abs(correlations(noise, related)).max() > z
    assert found >= stats.binom.ppf(1e-4, 40, 0.99)


@every_sampler
def test_neighbours_at_any_distance_are_independent(sampler):
    """Each of the four numbers with itself at every shift but 0."""
    for picture in pictures(sampler):
        z = correlations(picture, picture)
        z[0, 0] = 0
        assert np.abs(z).max() < limit(N / 2)


@every_sampler
@pytest.mark.parametrize("changed", ["dimension", "seed", "block", "bounce", "sample"])
def test_other_numbers_of_any_pixel_are_independent(sampler, changed):
    """The four numbers against those of the next seed, block, bounce: all shifts.

    Samples of one pixel are stratified: there the shift 0 is not looked at.
    """
    here = pictures(sampler)
    if changed == "dimension":
        pairs = [(here[i], here[j]) for i, j in combinations(range(4), 2)]
    else:
        there = pictures(
            sampler._replace(seed=sampler.seed + (changed == "seed")),
            sample=3 + (changed == "sample"),
            block={"block": 2, "bounce": 1 + (1 << 20)}.get(changed, 1),
        )
        pairs = list(zip(here, there, strict=True))
    for a, b in pairs:
        z = correlations(a, b)
        if changed == "sample" and not isinstance(sampler, Independent):
            z[0, 0] = 0
        assert np.abs(z).max() < limit(N)


DEEP = 1 << 20  # blocks of a bounce


@pytest.mark.parametrize("sampler", [*SAMPLERS, make_sobol(7, 1)], ids=label)
@pytest.mark.parametrize(
    ("block", "far"),
    [
        (1, 1 + 4096 * DEEP),
        (1, 1 + 6144 * DEEP),
        (2, 2 + 4096),
        (2, 2 + 4097),
        (2 + DEEP, 2 + 65536),
    ],
    ids=["bounce 4096", "bounce 6144", "light 4096", "light 4097", "light 65536"],
)
def test_deep_bounces_and_far_lights_have_numbers_of_their_own(sampler, block, far):
    """The numbers of a block have 32 bits in a hash: none comes again where they end.

    Sixteen correlations over 2^16 pixels, all cases together 640: by chance once in 2700;
    a correlation of 0.029 is found with 99 %. Numbers that come again have one of 1.
    """
    pixels = PIXELS[: 1 << 16]
    both = [(draw(sampler, pixels, 0, b) - 0.5) * np.sqrt(12) for b in (block, far)]
    z = both[0] @ both[1].T / np.sqrt(pixels.size)
    assert np.abs(z).max() < 5


EDGES = np.linspace(0, 1, 9)
EVEN = np.full((8, 8), 1 / 64)


@every_sampler
def test_pairs_of_numbers_fill_the_square_evenly(sampler):
    """All six pairs of a draw: 8 x 8 cells, over 2^18 pixels."""
    numbers = draw(sampler, PIXELS, 5, 3)
    for i, j in combinations(range(4), 2):
        counts = histogram(numbers[i], numbers[j], EDGES, EDGES)
        assert_follows(counts, EVEN, N, finds=0.04, tests=6)


@every_sampler
def test_pairs_across_draws_fill_the_square_evenly(sampler):
    """Film against light, pixel against pixel, seed against seed, in each dimension."""
    film = draw(sampler, PIXELS, 0, 0)
    others = [
        draw(sampler, PIXELS, 0, 2),
        draw(sampler, PIXELS + 1, 0, 0),
        draw(sampler, PIXELS + SIDE, 0, 0),
        draw(sampler._replace(seed=sampler.seed + 1), PIXELS, 0, 0),
    ]
    for other in others:
        for a, b in zip(film, other, strict=True):
            counts = histogram(a, b, EDGES, EDGES)
            assert_follows(counts, EVEN, N, finds=0.04, tests=16)


# ------------------------------------------------------------------- means over seeds


@every_sampler
def test_the_mean_over_seeds_has_a_kth_of_the_variance(sampler):
    """Var(mean of K seeds) = Var / K, K = 32 seeds in a row, 4 numbers of 2^16 pixels.

    Sums of squares of nearly normal means: 2^18 degrees of freedom, so the ratio is 1 +-
    0.0028. Seeds whose numbers correlate by r make it 1 + 31 r: r = 0.0007 is found with
    99 % at a false alarm rate of 1e-5.
    """
    seeds, pixels = 32, np.arange(1 << 16)
    draws = [draw(sampler._replace(seed=100 + k), pixels, 0, 1) for k in range(seeds)]
    mean = np.mean(draws, axis=0) - 0.5
    freedom = mean.size
    ratio = np.mean(mean**2) * 12 * seeds
    low, high = stats.chi2.ppf([FALSE_ALARM / 2, 1 - FALSE_ALARM / 2], freedom) / freedom
    assert low < ratio < high
    assert (high - 1) * (1 + 2.33 / 4.42) < 31 * 0.0007


def test_pictures_of_different_seeds_are_independent():
    """Var(mean of K pictures) = Var / K, of a white furnace, whose every pixel is 1.

    K = 16 seeds, 32 x 32 pixels: the ratio is 1 +- 0.05. Pictures whose noise correlates
    by 3 % make it 1.45: found with 99 % at a false alarm rate below 1e-4.
    """
    camera = sensor((-2.5, -8, 0), (-2.5, 0, 0), fov=8, size=(32, 32), spp=4, jitter=True)
    loaded = renderer.load_dict(white_furnace() | {"sensor": camera})
    # only light samples of the sky have noise here
    options: Any = {"integrator": "path", "light_choice": "uniform"}
    images = np.array(
        [renderer.render(loaded, seed=k, **options) for k in range(16)], float
    )[..., 0]
    noise = images.var(axis=0, ddof=1).mean() / 16
    assert noise > 1e-6
    ratio = np.mean((images.mean(axis=0) - 1) ** 2) / noise
    assert abs(ratio - 1) < 0.25

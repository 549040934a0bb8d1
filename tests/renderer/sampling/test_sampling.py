"""Random numbers and warps: uniform, stratified, independent, and without bias.

All seeds are fixed, so nothing here fails by chance; limits in sigma are chosen such that a
correct sampler would have passed with probability 0.9999 for all of a test's cases. What
they find with 99 %, from 65,536 pixels: a density tilted by 8 % from end to end in 64 bins,
by 10 % in 256 cells; a correlation of 0.029; a mean that is 7.4 standard errors off.
tests/renderer/sampling/test_sampler_independence.py looks closer, at any distance between
pixels.
"""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import chi_square_z, key_of, mean_z
from sampler_probes import draw, label, multijitter, samplers, whole_grid

from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.functions import as_i32, splat_u32
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import store3, vec3
from renderer.plugins.sampling.numbers_and_warps import (
    MOST_BY_PAIR,
    Independent,
    Stratified,
    choose_from_draw,
    draw4,
    permute,
    power_heuristic,
    square_to_cosine_hemisphere,
    square_to_disk,
    square_to_sphere,
)
from renderer.plugins.sampling.sobol import make_sobol

PIXELS = 1 << 16
GRIDS = [(8, 8), (4, 2), (5, 3), (3, 3), (7, 1), (1, 1)]
SIGMA = 5.0  # two-sided 6e-7, one-sided 3e-7


@entry_kernel
def run_choose(sampler, pixels, sample, block, count, chosen, left):
    for i in range(0, pixels.size, 16):
        x, _, _, w = draw4(sampler, key_of(load_row(pixels, 0, i)), sample, block)
        which, x = choose_from_draw(sampler, x, w, count)
        store_row(chosen, 0, i, which)
        store_row(left, 0, i, x)


@entry_kernel
def run_permute(index, size, keys, out):
    for i in range(0, keys.size, 16):
        place = permute(splat_u32(np.uint32(index)), size, load_row(keys, 0, i))
        store_row(out, 0, i, as_i32(place))


@entry_kernel
def run_warps(x, y, disk, hemisphere, sphere, weight):
    for i in range(0, x.size, 16):
        a, b = load_row(x, 0, i), load_row(y, 0, i)
        p, q = square_to_disk(a, b)
        store3(disk, i, vec3(p, q, 0.0))
        store3(hemisphere, i, square_to_cosine_hemisphere(a, b))
        store3(sphere, i, square_to_sphere(a, b))
        store_row(weight, 0, i, power_heuristic(a, b))


ALL = [
    Independent(7),
    *samplers(8, 8),
    *samplers(5, 3),
    *samplers(7, 1),
    make_sobol(7, 64),
    make_sobol(7, 15),
]


every_sampler = pytest.mark.parametrize("sampler", ALL, ids=label)


# -------------------------------------------------------------------------- the numbers


@pytest.mark.parametrize("sampler", [multijitter(7, 8, 8), make_sobol(7, 64)], ids=label)
@pytest.mark.parametrize("count", [3, 4096, 4097, 65_536, 1 << 20])
def test_enough_is_left_of_the_number_that_chooses(sampler, count):
    """Of 2^16 draws: what is left has 4096 values or more, and no tie to what was chosen.

    A mean of 0.5 and no correlation within 5 standard errors, of which 0.469, what 2^20
    things leave of 24 bits, is 27 off.
    """
    pixels = np.arange(PIXELS, dtype=np.uint32)
    chosen, left = np.empty((1, PIXELS), np.int32), np.empty((1, PIXELS), np.float32)
    run_choose(sampler, pixels, 5, 2, count, chosen, left)
    x, _, _, w = draw(sampler, pixels, 5, 2)
    by_pair = count <= MOST_BY_PAIR
    scaled = np.float32(x if by_pair else w) * np.float32(count)
    np.testing.assert_array_equal(chosen[0], np.minimum(scaled, count - 1).astype(int))
    np.testing.assert_array_equal(left[0], scaled - chosen[0] if by_pair else np.float32(x))
    assert np.unique(left).size >= 4096
    z = (left[0].astype(float) - 0.5) * np.sqrt(12)
    other = (chosen[0] + 0.5) / count * np.sqrt(12) - np.sqrt(3)
    assert abs(z.sum()) < SIGMA * PIXELS**0.5
    assert count == 3 or abs(z @ other) < SIGMA * PIXELS**0.5


@every_sampler
def test_each_number_is_uniform(sampler):
    """Over pixels, for some samples and blocks: 64 bins, all in [0, 1)."""
    for sample, block in ((0, 0), (1, 1), (5, 2), (6, 257)):
        numbers = draw(sampler, np.arange(PIXELS), sample, block)
        assert numbers.min() >= 0 and numbers.max() < 1
        for row in numbers:
            assert chi_square_z(np.bincount((row * 64).astype(int), minlength=64)) < SIGMA


@every_sampler
@pytest.mark.parametrize(
    "changed",
    ["pixel", "row of pixels", "block", "bounce", "seed"],
)
def test_neighbours_are_independent(sampler, changed):
    """|r| < 5 / sqrt(N), and 16 x 16 bins, against the next pixel, the next block, ..."""
    pixels = np.arange(PIXELS)
    step = {"pixel": 1, "row of pixels": 640}.get(changed, 0)
    block = {"block": 3, "bounce": 2 + 256}.get(changed, 2)
    other = sampler._replace(seed=sampler.seed + (changed == "seed"))
    a, b = draw(sampler, pixels, 2, 2), draw(other, pixels + step, 2, block)
    for i in range(4):
        for j in range(4):
            assert abs(np.corrcoef(a[i], b[j])[0, 1]) * np.sqrt(PIXELS) < SIGMA
        cells = (a[i] * 16).astype(int) * 16 + (b[i] * 16).astype(int)
        assert chi_square_z(np.bincount(cells, minlength=256)) < SIGMA


@every_sampler
def test_the_same_question_has_the_same_answer(sampler):
    """In any order and next to any other pixel: nothing is carried on."""
    pixels = np.random.default_rng(0).permutation(4096)
    forwards = draw(sampler, np.arange(4096), 9, 4)
    np.testing.assert_array_equal(draw(sampler, pixels, 9, 4), forwards[:, pixels])
    assert (draw(sampler, pixels, 10, 4) != forwards[:, pixels]).mean() > 0.99


def test_no_number_is_rounded_up_to_one():
    """(column + jitter) / columns can round to 1: places where it did, found by search."""
    plain, multi = samplers(10, 10, seed=1)
    found = {
        (plain, 1): 3496093,
        (plain, 6): 1116481,
        (plain, 10): 307446,
        (multi, 0): 3281094,
        (multi, 1): 350486,
        (multi, 7): 3272714,
    }
    for (sampler, sample), pixel in found.items():
        numbers = draw(sampler, [pixel], sample, 1)
        assert 0.9999999 < numbers.max() < 1


# ---------------------------------------------------------------------- stratification


@pytest.mark.parametrize(("columns", "rows"), GRIDS)
def test_each_cell_is_hit_once(columns, rows):
    """x, y together in the grid, z and w each in 1 / count, in every pixel and grid."""
    count = columns * rows
    for sampler in samplers(columns, rows):
        for first in (0, count, 7 * count):
            numbers = whole_grid(sampler, count, np.arange(512), first=first)
            x, y, z, w = numbers.transpose(1, 0, 2)
            cells = (x * columns).astype(int) + columns * (y * rows).astype(int)
            for place in (cells, (z * count).astype(int), (w * count).astype(int)):
                np.testing.assert_array_equal(
                    np.sort(place, axis=0), np.indices((count, 512))[0]
                )


@pytest.mark.parametrize(("columns", "rows"), GRIDS)
def test_multijitter_is_stratified_in_each_axis_too(columns, rows):
    """Projected to x or to y alone there is one sample in each 1 / count [Kensler2013]."""
    count = columns * rows
    numbers = whole_grid(multijitter(3, columns, rows), count, np.arange(256))
    for axis in (0, 1):
        place = (numbers[:, axis] * count).astype(int)
        np.testing.assert_array_equal(np.sort(place, axis=0), np.indices((count, 256))[0])


@pytest.mark.parametrize(("columns", "rows"), [(32, 32), (5, 3), (1, 1)])
def test_without_jitter_the_pairs_are_the_centres(columns, rows):
    """Each centre of the grid once. The single numbers stay random within their strata."""
    count = columns * rows
    numbers = whole_grid(Stratified(5, columns, rows, 0.0, None), count, np.arange(16))
    x, y, z, w = numbers.transpose(1, 0, 2)
    order = np.lexsort((x, y), axis=0)
    grid_y, grid_x = np.indices((rows, columns)).reshape(2, count, 1)
    for got, place, cells in ((x, grid_x, columns), (y, grid_y, rows)):
        centre = np.broadcast_to((place + 0.5) / cells, got.shape)
        np.testing.assert_allclose(np.take_along_axis(got, order, 0), centre, rtol=3e-7)
    for row in (z, w):
        from_centre = np.sort(row * count, axis=0) - np.arange(count)[:, None] - 0.5
        assert 0.3 < np.abs(from_centre).max() < 0.501


# ------------------------------------------------------------------------------- no bias

INTEGRALS = {
    "x": (lambda a: a[0], 1 / 2),
    "xy": (lambda a: a[0] * a[1], 1 / 4),
    "xyz": (lambda a: a[0] * a[1] * a[2], 1 / 8),
    "(x - y)^2": (lambda a: (a[0] - a[1]) ** 2, 1 / 6),
    "zw": (lambda a: a[2] * a[3], 1 / 4),
    "x < y": (lambda a: a[0] < a[1], 1 / 2),
}


@pytest.mark.parametrize(("columns", "rows"), [(2, 2), (4, 4), (3, 3), (4, 2), (7, 3)])
def test_estimates_over_whole_grids_have_no_bias(columns, rows):
    """Means over a pixel's samples, over 32768 pixels, within 5 standard errors.

    A multijittered sampler whose two inner places shared a key was 24 sigma off in xy:
    the sample of the first cell lay always on its diagonal.
    """
    count = columns * rows
    for sampler in (*samplers(columns, rows), make_sobol(7, count)):
        numbers = whole_grid(sampler, count, np.arange(1 << 15))
        for name, (function, expected) in INTEGRALS.items():
            means = np.mean([function(sample) for sample in numbers], axis=0)
            if name == "x < y" or means.std() > 0:
                assert abs(mean_z(means, expected)) < SIGMA, (label(sampler), name)


@pytest.mark.parametrize(("columns", "rows"), [(2, 2), (3, 1), (5, 1), (4, 3), (7, 2)])
def test_estimates_over_two_blocks_have_no_bias(columns, rows):
    """Film position times direction to a light: which cell meets which must be chance.

    It was not where the shuffles favoured some places: sizes that are no power of two.
    """
    count = columns * rows
    for sampler in (*samplers(columns, rows), make_sobol(7, count)):
        film = whole_grid(sampler, count, np.arange(1 << 15), block=0)
        light = whole_grid(sampler, count, np.arange(1 << 15), block=2)
        for i, j in ((0, 0), (0, 1), (1, 0), (2, 2), (2, 3), (0, 2)):
            means = np.mean(film[:, i] * light[:, j], axis=0)
            assert abs(mean_z(means, 0.25)) < SIGMA, (label(sampler), i, j)


# ----------------------------------------------------------------------------- permute


def places(index, size, keys):
    out = np.empty(keys.size, np.int32)
    run_permute(index, size, keys, out)
    return out


@pytest.mark.parametrize(
    "sizes", [range(1, 24), range(24, 48), range(48, 71), (1000, 1024)]
)
def test_permute_is_a_permutation(sizes):
    """For every size and key: each place exactly once."""
    keys = np.random.default_rng(1).integers(0, 2**32, 64, np.uint32)
    keys[:4] = 0, 1, 2**32 - 1, 2**31
    for size in sizes:
        table = np.array([places(index, size, keys) for index in range(size)])
        np.testing.assert_array_equal(np.sort(table, axis=0), np.indices((size, 64))[0])


@pytest.mark.parametrize("sizes", [range(2, 24), range(24, 48), range(48, 71), (256, 1000)])
def test_permute_prefers_no_place(sizes):
    """Over 65536 keys, for the first, the middle and the last index."""
    keys = np.random.default_rng(2).integers(0, 2**32, PIXELS, np.uint32)
    for size in sizes:
        for index in {0, size // 2, size - 1}:
            counts = np.bincount(places(index, size, keys), minlength=size)
            assert chi_square_z(counts) < SIGMA, (size, index)


# -------------------------------------------------------------------------------- warps


def warped(x, y):
    """Disk, hemisphere, sphere (n, 3) each, and power heuristics (n,)."""
    x, y = (np.ascontiguousarray(a, np.float32) for a in np.broadcast_arrays(x, y))
    n = x.size
    x, y = (np.pad(a, (0, -n % 16)) for a in (x, y))
    out = [np.empty((3, x.size), np.float32) for _ in range(3)]
    weight = np.empty(x.size, np.float32)
    run_warps(x, y, *out, weight)
    return *(a[:, :n].T.astype(float) for a in out), weight[:n]


def cells(a, b):
    """Counts of pairs in [0, 1]^2 in 16 x 16 bins."""
    return np.histogram2d(a, b, 16, [[0, 1], [0, 1]])[0]


def random_square():
    return np.random.default_rng(3).random((2, PIXELS)).astype(np.float32)


def turn(v):
    return (np.arctan2(v[:, 1], v[:, 0]) / (2 * np.pi)) % 1


def test_the_hemisphere_has_density_cos_over_pi():
    """z^2 and the longitude are uniform and independent; mean of z is 2/3."""
    _, hemisphere, _, _ = warped(*random_square())
    np.testing.assert_allclose(np.linalg.norm(hemisphere, axis=1), 1, rtol=3e-7)
    z = hemisphere[:, 2]
    assert z.min() >= 0
    assert chi_square_z(cells(z * z, turn(hemisphere))) < SIGMA
    assert abs(mean_z(z, 2 / 3)) < SIGMA


def test_the_warps_keep_neighbours():
    """Stratification survives: a step of 1/1000 in the square moves a point by < 1/100."""
    t = (np.arange(1000) + 0.5) / 1000
    x, y = (a.ravel() for a in np.meshgrid(t, t))
    disk, hemisphere, _, _ = warped(x, y)
    for points, most in ((disk, 0.0035), (hemisphere[:, :2], 0.0035)):
        grid = points.reshape(1000, 1000, -1)
        for axis in (0, 1):
            assert np.linalg.norm(np.diff(grid, axis=axis), axis=2).max() < most


def test_the_corners_of_the_square_are_safe():
    """0, the centre (where both halves of the disk's map meet) and the largest below 1."""
    last = np.float32(1 - 2.0**-24)
    special = np.array(
        [0.0, 0.25, 0.5, 0.75, last, np.nextafter(np.float32(0.5), np.float32(0))]
    )
    x, y = (a.ravel() for a in np.meshgrid(special, special))
    disk, hemisphere, sphere, _ = warped(x, y)
    for points in (disk, hemisphere, sphere):
        assert np.isfinite(points).all()
    assert np.linalg.norm(disk, axis=1).max() <= 1 + 2e-7
    for points in (hemisphere, sphere):
        np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1, rtol=5e-4)
    np.testing.assert_array_equal(disk[(x == 0.5) & (y == 0.5)], 0)


def test_power_heuristic():
    """a^2 / (a^2 + b^2): 3 to 1 is 0.9; the two weights of a direction add up to 1."""
    a = np.array([1, 3, 1, 5, 1e-10, 1e15, 2], np.float32)
    b = np.array([1, 1, 3, 0, 1e-10, 1e15, 1e15], np.float32)
    weight = warped(a, b)[3]
    np.testing.assert_allclose(weight, [0.5, 0.9, 0.1, 1, 0.5, 0.5, 4e-30], rtol=3e-7)
    np.testing.assert_allclose(weight + warped(b, a)[3], 1, rtol=3e-7)


def test_grids_of_millions_of_cells_stay_inside_the_unit_square():
    """Cells beyond 2^22: the float32 quotient that finds the row errs by one.

    Unmended, a column was -1, so a number below 0; with multi-jittering that left the
    set that `permute` permutes, and its walk might never come back.
    """
    columns = rows = 4096
    keys = np.arange(16, dtype=np.uint32)
    for multi in (None, 1):
        sampler = Stratified(1, columns, rows, 1.0, multi)
        for sample in range(0, columns * rows, 65537 * 3):
            for numbers in draw(sampler, keys, sample, 1):
                assert (numbers >= 0).all()
                assert (numbers < 1).all()

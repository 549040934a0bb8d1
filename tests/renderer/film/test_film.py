"""The film: filter weights of each sample against NumPy, tiles, crop, double sums."""

from __future__ import annotations

import numpy as np
import pytest

import renderer.rendering.film.film
from renderer.integrators.stages.camera_rays import draw_film
from renderer.integrators.stages.film import (
    BOX,
    add_to_tile,
    close_sums,
    filter_border,
    filter_table,
    open_sums,
)
from renderer.kernels.jit import entry_kernel, pack
from renderer.kernels.records.batch import CAPACITY, TILE_SIZE, Tile, make_workspace
from renderer.plugins.sampling.numbers_and_warps import Independent
from renderer.rendering.film.film import Film
from renderer.scene.reconstruction import lookup_weight, pixels_touched
from renderer.scene_file.description import ReconstructionFilter


@entry_kernel
def run_add_to_tile(rfilter, tile, film, radiance, sums, splats, border):
    open_sums(rfilter, sums, splats)
    add_to_tile(rfilter, tile, film, radiance, sums, splats, border)
    close_sums(rfilter, sums, splats)


@entry_kernel
def run_draw_film(sampler, tile, sample, film):
    draw_film(sampler, tile, sample, film)


FILTERS = [
    ReconstructionFilter("box", 0.5),
    ReconstructionFilter("tent", 1.0),
    ReconstructionFilter("gaussian", 2.0),
    ReconstructionFilter("mitchell", 2.0),
    ReconstructionFilter("catmullrom", 2.0),
    ReconstructionFilter("lanczos", 3.0),
    ReconstructionFilter("tent", 1.7),
    ReconstructionFilter("gaussian", 0.8, stddev=0.2),
]
every_filter = pytest.mark.parametrize(
    "rfilter", FILTERS, ids=lambda f: f"{f.name} {f.radius}"
)
CHANNELS = 2
FILM_WIDTH = 200
# The renderer's own record: classes of a test in the types of kernels would be in the index
# of the kernel cache, which other programs then cannot read.
SAMPLER = pack(Independent(5))


def slots():
    """x and y in the tile of each slot: 4 x 4 pixels at a time."""
    s = np.arange(CAPACITY)
    return (s & 3) | (((s >> 4) & 7) << 2), ((s >> 2) & 3) | ((s >> 7) << 2)


def tiles_of(film):
    return [film.tile(number) for number in range(len(film.tiles))]


def samples(tile, sample, seed=0):
    """Film positions (2, slots), radiance (2, slots), and the slots inside the tile."""
    positions = np.zeros((2, CAPACITY), np.float32)
    run_draw_film(SAMPLER, tile, sample, positions)
    x, y = slots()
    positions += np.float32([x + tile.x, y + tile.y])
    radiance = np.random.default_rng([seed, tile.x, tile.y, sample]).random(
        (CHANNELS, CAPACITY)
    )
    return positions, radiance.astype(np.float32), (x < tile.width) & (y < tile.height)


def by_hand(rfilter, tiles, window, sample_count):
    """The window's sums, sample by sample, with `renderer.scene.reconstruction`."""
    x0, y0, width, height = window
    sums = np.zeros((CHANNELS + 1, height, width))
    table = filter_table(rfilter)
    for tile in tiles:
        slot_x, slot_y = slots()
        for sample in range(sample_count):
            positions, radiance, inside = samples(tile, sample)
            for s in np.flatnonzero(inside):
                value = np.append(radiance[:, s].astype(float), 1.0)
                if table.weights.size == 0:  # the box
                    row, column = slot_y[s] + tile.y - y0, slot_x[s] + tile.x - x0
                    sums[:, row, column] += value
                    continue
                px, py = positions[:, s].astype(float) - [x0, y0]
                rows = pixels_touched(py, table.radius, height)
                columns = pixels_touched(px, table.radius, width)
                wy = lookup_weight(table.weights, table.radius, np.array(rows) + 0.5 - py)
                wx = lookup_weight(
                    table.weights, table.radius, np.array(columns) + 0.5 - px
                )
                weights = np.multiply.outer(wy, wx)
                part = np.s_[:, rows.start : rows.stop, columns.start : columns.stop]
                sums[part] += value[:, None, None] * weights
    return sums


def by_kernel(rfilter, film, sample_count, constant=None):
    table, border = pack(filter_table(rfilter)), film.grid.border
    splats = make_workspace(channels=CHANNELS, splat_size=TILE_SIZE + 2 * border).splats
    for tile, sums in zip(tiles_of(film), film.sums, strict=True):
        for sample in range(sample_count):
            positions, radiance, _ = samples(tile, sample)
            if constant is not None:
                radiance[:] = constant
            run_add_to_tile(table, tile, positions, radiance, sums, splats, border)
    return film


def window_sums(film):
    """The sums of the window's pixels, tile after tile: what `develop` divides."""
    border = film.grid.border
    whole = np.zeros((len(film.sums[0]), film.height + 200, film.width + 200))
    for tile, sums in zip(tiles_of(film) * film.grid.layers, film.sums, strict=True):
        y, x = tile.y - film.y - border + 100, tile.x - film.x - border + 100
        whole[:, y : y + sums.shape[1], x : x + sums.shape[2]] += sums
    return whole[:, 100 : 100 + film.height, 100 : 100 + film.width]


def make_film(rfilter, window):
    return Film(CHANNELS, *window, filter_border(filter_table(rfilter)), FILM_WIDTH)


@every_filter
def test_one_whole_tile(rfilter):
    """32 x 32 pixels: each sample reaches exactly the pixels it should, by its weight."""
    window = (0, 0, 32, 32)
    film = by_kernel(rfilter, make_film(rfilter, window), 2)
    expected = by_hand(rfilter, tiles_of(film), window, 2)
    np.testing.assert_allclose(window_sums(film), expected, rtol=1e-12, atol=1e-13)


@every_filter
def test_tiles_of_a_crop_window(rfilter):
    """37 x 35 pixels from (5, 7) on: four tiles, three of them cut, borders overlapping."""
    window = (5, 7, 37, 35)
    film = by_kernel(rfilter, make_film(rfilter, window), 1)
    assert [(t.width, t.height) for t in tiles_of(film)] == [
        (32, 32),
        (5, 32),
        (32, 3),
        (5, 3),
    ]
    expected = by_hand(rfilter, tiles_of(film), window, 1)
    np.testing.assert_allclose(window_sums(film), expected, rtol=1e-12, atol=1e-13)


@every_filter
def test_a_constant_stays_constant(rfilter):
    """sum(w v) / sum(w) up to the rim, where neighbours are missing; negative lobes too."""
    film = by_kernel(rfilter, make_film(rfilter, (3, 0, 40, 20)), 4, constant=0.7)
    picture = film.develop()
    assert picture.shape == (20, 40, CHANNELS) and picture.dtype == np.float32
    np.testing.assert_allclose(picture, np.float32(0.7), rtol=1e-6)


def test_tiles_cover_the_window_once():
    for window in ((0, 0, 1, 1), (3, 5, 32, 32), (0, 0, 33, 65), (100, 7, 95, 31)):
        film = Film(3, *window, 0, FILM_WIDTH)
        count = np.zeros((window[3], window[2]), int)
        for tile in tiles_of(film):
            assert 0 < tile.width <= TILE_SIZE and 0 < tile.height <= TILE_SIZE
            left, top = tile.x - window[0], tile.y - window[1]
            count[top : top + tile.height, left : left + tile.width] += 1
        assert (count == 1).all()


def test_sums_are_double():
    """Beyond 2^24 single precision cannot count, and 0.1 drifts by 9 % (row 26)."""
    tile = Tile(0, 0, 32, 32, FILM_WIDTH)
    [sums] = Film(CHANNELS, 0, 0, 32, 32, 0, FILM_WIDTH).sums
    sums[:] = 2.0**24
    radiance = np.full((CHANNELS, CAPACITY), 0.1, np.float32)
    positions = np.zeros((2, CAPACITY), np.float32)
    for _ in range(1000):
        run_add_to_tile(pack(BOX), tile, positions, radiance, sums, np.zeros(0), 0)
    np.testing.assert_allclose(sums[-1] - 2.0**24, 1000, rtol=0)
    tenth = float(np.float32(0.1))
    np.testing.assert_allclose(sums[0] - 2.0**24, 1000 * tenth, rtol=1e-6)
    single = np.float32(2.0**24)
    assert single + np.float32(1) == single


def test_no_weight_is_black_and_not_nan():
    film = Film(1, 0, 0, 4, 3, 0, FILM_WIDTH)
    [sums] = film.sums
    sums[:, 0, 0] = 3, 2
    sums[:, 0, 1] = -3, -2  # a pixel can have negative lobes alone
    picture = film.develop()[:, :, 0]
    assert picture[0, 0] == picture[0, 1] == 1.5
    assert np.count_nonzero(picture) == 2 and np.isfinite(picture).all()


def test_what_lies_beyond_the_window_is_dropped():
    """A tile's border reaches over the rim on every side."""
    film = Film(1, 10, 20, 4, 3, 2, FILM_WIDTH)
    film.sums[:] = 1e9
    film.sums[0, :, 2:5, 2:6] = [[[3.0]], [[2.0]]]
    np.testing.assert_array_equal(film.develop()[..., 0], np.full((3, 4), 1.5))


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("border", [0, 2, 5])
@pytest.mark.parametrize(("beyond", "layers"), [(0, 1), (3, 1), (0, 3)])  # of 12 tiles
def test_developing_adds_the_tiles_up(border, beyond, layers, threads, monkeypatch):
    """All that overlap at a pixel, also where samples were taken beyond the window."""
    monkeypatch.setattr(renderer.rendering.film.film, "ALONE", 0)
    film = Film(3, 7, 9, 70, 99, border, FILM_WIDTH, beyond, 12 * layers)
    assert film.grid.layers == layers
    film.sums[:] = np.random.default_rng(border).random(film.sums.shape)
    *values, weight = window_sums(film)
    expected = np.stack(values, axis=-1) / weight[..., None]
    np.testing.assert_allclose(film.develop(threads), expected, rtol=1e-6)


def test_borders_hold_the_widest_reach():
    """A sample at the very rim of its pixel, half a pixel off the centre."""
    for rfilter in FILTERS:
        border = filter_border(filter_table(rfilter))
        if rfilter.name == "box":
            assert border == 0
        else:
            assert rfilter.radius + 0.5 <= border < rfilter.radius + 1.5

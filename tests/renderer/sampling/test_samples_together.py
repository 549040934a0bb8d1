"""Samples of a pixel that are traced together: other batches, and not one other bit."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import key_of
from small_scenes import (
    diffuse,
    floor,
    glass,
    mirror,
    point_light,
    rectangle,
    scene,
    sensor,
    sky,
    sphere,
)

import renderer
from renderer.kernels.jit import entry_kernel, pack
from renderer.kernels.lanes.functions import as_i32, lane_index
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.records.batch import (
    CAPACITY,
    SampleKey,
    Tile,
    has_places,
    pixel_slot,
    sample_key,
    slot_pixel,
)
from renderer.plugins.sampling.numbers_and_warps import Independent, Stratified, draw4
from renderer.plugins.sampling.sobol import make_sobol
from renderer.process.names import REPLAY, SAMPLERS
from renderer.rendering.job import RenderJob
from renderer.rendering.planning import plan as planning
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.planning.plan import MOST_TOGETHER
from renderer.rendering.render_options import RenderOptions

LEVELS = range(MOST_TOGETHER + 1)
FILM_WIDTH = 77
SPP = 23  # of them 16 together, then 4, then one by one


@entry_kernel
def run_slots(tile, where, back):
    """Write (x, y), number in the film and number of the sample for each slot of a tile."""
    for first in range(0, where.shape[1], 16):
        slot = lane_index() + first
        x, y = slot_pixel(slot, tile.level)
        key = sample_key(tile, slot)
        store_row(where, 0, first, x)
        store_row(where, 1, first, y)
        store_row(where, 2, first, as_i32(key.pixel))
        store_row(where, 3, first, as_i32(key.later))
        for k in range(first, first + 16):
            x, y, later = where[0, k], where[1, k], where[3, k]
            back[k] = pixel_slot(x, y, later, tile.level)


@entry_kernel
def run_has_places(tile):
    return has_places(tile)


@pytest.mark.parametrize("level", LEVELS)
def test_slots_are_all_samples_of_all_pixels(level):
    """Each once, and back; 16 neighbouring slots are as few pixels as may be."""
    count = 1024 * 4**level
    where, back = np.zeros((4, count), np.int32), np.zeros(count, np.int32)
    tile = Tile(5, 7, 32, 32, FILM_WIDTH, level, 0)
    run_slots(tile, where, back)
    x, y, pixel, later = where
    np.testing.assert_array_equal(pixel, (y + 7) * FILM_WIDTH + x + 5)
    np.testing.assert_array_equal(np.sort((later * 32 + y) * 32 + x), np.arange(count))
    np.testing.assert_array_equal(back, np.arange(count))
    for together, side in ((16, 4), (1024, 32)):
        extent = np.ptp(where[:2].reshape(2, -1, together), axis=2)
        assert (extent == (side >> level) - 1).all()


@pytest.mark.parametrize(("width", "height"), [(32, 32), (5, 32), (17, 9), (1, 1)])
@pytest.mark.parametrize("level", LEVELS)
def test_squares_without_pixels_are_left_out(level, width, height):
    side = 32 >> level
    across = 1 << level
    for square in range(4**level):
        j, i = divmod(square, across)
        there = i * side < width and j * side < height
        assert run_has_places(Tile(0, 0, width, height, 99, level, square)) == there


@entry_kernel
def run_later(sampler, pixels, later, sample, out):
    for i in range(0, pixels.size, 16):
        together = SampleKey(load_row(pixels, 0, i), load_row(later, 0, i))
        row = 0
        for number in draw4(sampler, together, sample, 3):
            store_row(out, row, i, number)
            row += 1


@entry_kernel
def run_alone(sampler, pixels, sample, out):
    for i in range(0, pixels.size, 16):
        row = 0
        for number in draw4(sampler, key_of(load_row(pixels, 0, i)), sample, 3):
            store_row(out, row, i, number)
            row += 1


@pytest.mark.parametrize(
    "sampler",
    [
        Independent(3),
        Stratified(3, 8, 6, 1.0, None),
        Stratified(3, 8, 6, 1.0, 1),
        make_sobol(3, 48),
        make_sobol(3, 64),
    ],
    ids=["independent", "stratified", "multijitter", "sobol", "net"],
)
def test_numbers_of_samples_together_are_those_of_each_alone(sampler):
    """In the second grid of the strata, too, and beyond 32 bits."""
    pixels = np.arange(64, dtype=np.uint32) * 991
    later = np.arange(64, dtype=np.uint32) % 16
    together, alone = (np.zeros((4, 64), np.float32) for _ in range(2))
    for first in (0, 32, 48 + 16, 48 << 32):
        run_later(pack(sampler), pixels, later, first, together)
        for k in range(16):
            run_alone(pack(sampler), pixels, first + k, alone)
            mine = later == k
            np.testing.assert_array_equal(together[:, mine], alone[:, mine])


def room(rfilter="box", integrator="path", **settings):
    """A ball of metal over a floor under a lamp; 70 x 40 pixels are six tiles, four cut."""
    camera = sensor((0, -6, 3), (0, 0, 0.5), fov=40, size=(70, 40), rfilter=rfilter)
    lamp = rectangle((0, 0, 4), (1, 0, 0), (0, -1, 0), diffuse(0.0), shine=9.0)
    return renderer.load_dict(
        scene(camera, integrator, floor(), sphere(mirror(0.8)), lamp, **settings)
    )


def pictures(monkeypatch, loaded, **how):
    """The picture by one sample of a pixel at a time; then by more that go together.

    Last, with other numbers of squares in a batch.
    """
    for level, squares in ((0, 4), (1, 4), (2, 4), (2, 1), (2, 16)):
        monkeypatch.setattr(planning, "MOST_TOGETHER", level)
        monkeypatch.setattr(planning, "MOST_SQUARES", squares)
        plan = make_plan(loaded, spp=how["spp"], sampler=how["sampler"])
        assert RenderJob(loaded, plan, RenderOptions(seed=4, threads=1)).level == level
        yield renderer.render(loaded, seed=4, **how)


def assert_all_the_same(found):
    first, *others = found
    assert np.asarray(first).std() > 0.01
    for other in others:
        np.testing.assert_array_equal(np.asarray(other), np.asarray(first))
        for name, values in first.aovs.items():
            np.testing.assert_array_equal(other.aovs[name], values)


@pytest.mark.parametrize("rfilter", ["box", "gaussian"])
@pytest.mark.parametrize("sampler", [name for name in SAMPLERS if name != "orthogonal"])
def test_no_bit_depends_on_who_goes_together(monkeypatch, sampler, rfilter):
    """Strata are 8 x 8, which 16 divide."""
    how = {"spp": 64 if sampler in ("stratified", "multijitter", "ldsampler") else SPP}
    assert_all_the_same(pictures(monkeypatch, room(rfilter), sampler=sampler, **how))


@pytest.mark.parametrize(
    "settings",
    [
        {"integrator": "direct", "shading_samples": 3},
        {"integrator": "path", "hide_emitters": True},
        {"integrator": "moment", "inner": {"type": "path"}},
    ],
    ids=lambda settings: settings["integrator"],
)
def test_nor_in_another_integrator(monkeypatch, settings):
    how = {"spp": SPP, "sampler": "independent", "threads": 2}
    assert_all_the_same(pictures(monkeypatch, room(**settings), **how))


def test_nor_where_panes_refract_light_samples(monkeypatch):
    camera = sensor((0, -6, 3), (0, 0, 0.5), fov=40, size=(70, 40))
    lamp = rectangle((0, 0, 4), (1, 0, 0), (0, -1, 0), diffuse(0.0), shine=9.0)
    pane = rectangle((0, 0, 2.5), (1, 0, 0), (0, 1, 0.5), glass())
    parts = floor(), sphere(mirror(0.8)), lamp, pane, sky(0.1)
    loaded = renderer.load_dict(scene(camera, "path", *parts))
    assert make_plan(loaded).through_panes
    how = {"spp": SPP, "sampler": "independent", "threads": 2}
    assert_all_the_same(pictures(monkeypatch, loaded, **how))


def glass_under_a_sky():
    """Balls of glass from near: of a sample's many branches three or more add light."""
    camera = sensor((0, -6, 3), (0.9, 0, 0.5), fov=8, size=(96, 64))
    lamp = rectangle((0, 0, 4), (1, 0, 0), (0, -1, 0), diffuse(0.0), shine=9.0)
    glasses = sphere(glass()), sphere(glass(1.3), radius=0.6)
    beside = sphere(mirror(0.8), center=(2.2, 1, 0.5))
    parts = floor(), *glasses, beside, lamp, sky(0.7)
    return renderer.load_dict(scene(camera, "whitted", *parts, max_depth=6, cutoff=1e-4))


@pytest.mark.parametrize(
    "loaded",
    [room(), room("gaussian"), glass_under_a_sky()],
    ids=["box", "gaussian", "whitted"],
)
def test_nor_on_where_a_job_begins(loaded):
    """The groups are 16, 4 and 3 samples; then 3, 1, 4, 1, 3, 4, 4 and 3."""
    plan = make_plan(loaded, spp=SPP, sampler="independent")
    job = RenderJob(loaded, plan, RenderOptions(threads=1))
    film = job.make_film()
    whole, pieces = (np.zeros_like(film.sums) for _ in range(2))
    for tile in range(len(film.tiles)):
        job.add_to(whole[tile], film, tile, 0, SPP, thread=0)
        for begin, end in ((0, 3), (3, 9), (9, SPP)):
            job.add_to(pieces[tile], film, tile, begin, end, thread=0)
    assert whole.any()
    np.testing.assert_array_equal(pieces, whole)


def test_nor_in_strips_of_tiles_behind_a_lens(monkeypatch):
    """24 tiles of a crop window, those at its edges cut, traced in strips without sums."""
    camera = sensor(
        (0, -6, 3), (0, 0, 0.5), fov=40, size=(260, 190), crop=(11, 9, 170, 110)
    )
    camera |= {"type": "thinlens", "aperture_radius": 0.2, "focus_distance": 6.0}
    lamp = rectangle((0, 0, 4), (1, 0, 0), (0, -1, 0), diffuse(0.0), shine=9.0)
    loaded = renderer.load_dict(scene(camera, "path", floor(), sphere(mirror(0.8)), lamp))
    how = {"spp": 16, "sampler": "independent", "threads": 2}
    assert_all_the_same(pictures(monkeypatch, loaded, **how))


@pytest.mark.parametrize(
    ("spp", "sampler", "level"),
    [
        (1, "independent", 0),
        (4, "independent", 1),
        (15, "sobol", 1),
        (16, "sobol", 2),
        (4096, "independent", 2),
        (25, "multijitter", 0),  # strata of 5 x 5
        (36, "stratified", 1),
        (64, "stratified", 2),
        (64, REPLAY, 0),  # Mitsuba's streams go on from sample to sample
    ],
)
def test_how_many_go_together(spp, sampler, level):
    assert make_plan(room(), spp=spp, sampler=sampler).level == level


@pytest.mark.parametrize("integrator", ["work", "depth", "aov", "whitted"])
def test_others_go_sample_by_sample(integrator):
    assert make_plan(room(), spp=64, integrator=integrator).level == 0


def test_where_all_lights_are_asked_a_job_is_fewer_samples():
    """Of five lights three samples: they have room for one at a time."""
    camera = sensor((0, -6, 3), (0, 0, 0.5), fov=40, size=(8, 8))
    for lights, level in ((1, 2), (2, 1), (4, 1), (5, 0)):
        above = [point_light((x, 0, 4)) for x in range(lights)]
        loaded = renderer.load_dict(scene(camera, "direct", floor(), *above))
        plan = make_plan(loaded, spp=64, sampler="independent")
        job = RenderJob(loaded, plan, RenderOptions(threads=1))
        assert job.level == level
        slots = job.make_workspace(job.shape.channels).radiance.shape[1]
        assert slots // CAPACITY == 4**level

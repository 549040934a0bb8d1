"""How samples are dealt out to the sums of a film: each once, in one order."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import renderer
from renderer.rendering.film import band as finished_tiles
from renderer.rendering.film.film import Work
from renderer.rendering.job import RenderJob
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.render_loop import run
from renderer.rendering.render_options import RenderOptions

SCENES = Path(__file__).parents[3] / "scenes"


@pytest.mark.parametrize(("layers", "part"), [(1, 16), (3, 4), (8, 1), (5, 7)])
@pytest.mark.parametrize("spp", [0, 1, 6, 16, 97])
def test_every_sample_belongs_to_one_place(layers, part, spp):
    work = Work(tiles=2, layers=layers, part=part)
    samples = work.samples(spp)
    assert samples.shape == (work.places,)
    assert work.least_spp(samples) == spp
    for tile in range(2):
        taken = []
        for place in range(tile, work.places, 2):
            pieces = list(work.pieces(place, 0, int(samples[place])))
            assert all(0 < end - first <= part for first, end in pieces)
            numbers = [n for first, end in pieces for n in range(first, end)]
            assert numbers == sorted(numbers)
            assert {n // part % layers for n in numbers} <= {place // 2}
            taken += numbers
        assert sorted(taken) == list(range(spp))


@pytest.mark.parametrize("cut", [0, 3, 4, 9, 12])
def test_a_place_goes_on_where_it_was(cut):
    work = Work(tiles=3, layers=2, part=4)

    def numbers(begin, end):
        return [n for first, last in work.pieces(5, begin, end) for n in range(first, last)]

    assert numbers(0, cut) + numbers(cut, 12) == numbers(0, 12)


def test_places_that_have_come_unequally_far_end_as_the_same_picture():
    """Sums taken from another render, and parts that were begun and not ended."""
    box = renderer.load_file(SCENES / "cornell-box" / "scene.xml", width=48, height=48)
    plan = make_plan(box, spp=150, sampler="independent")

    job = RenderJob(box, plan, RenderOptions(seed=5, threads=2))
    whole, first, second = (job.make_film() for _ in range(3))
    assert run(job, whole).complete
    wanted = first.work.samples(plan.spp)
    assert first.work.layers > 1
    rng = np.random.default_rng(2)
    for place in range(first.work.places):
        for end in sorted(rng.integers(0, wanted[place], 2, endpoint=True)):
            job.add_samples(first, place, int(end), 0)
    second.sums[...] = first.sums
    second.samples[:] = first.samples
    assert 0 < second.samples_done < second.pixels * plan.spp
    assert run(job, second).complete
    assert second.samples_done == second.pixels * plan.spp == whole.samples_done
    assert np.array_equal(second.sums, whole.sums)


@pytest.fixture
def plan_of_a_crop_window():
    """It begins and ends inside of tiles of the full film: 20 tiles, 5 in a row."""
    text = (SCENES / "appel-teapot" / "scene.xml").read_text()
    crop = {"width": 150, "height": 110, "offset_x": 37, "offset_y": 21}
    lines = "".join(f'<integer name="crop_{k}" value="{v}"/>' for k, v in crop.items())
    text = text.replace('<rfilter type="box"/>', f'<rfilter type="box"/>{lines}')
    folder = SCENES / "appel-teapot"
    scene = renderer.load_string(text, base_dir=folder, width=300, height=200)
    return scene, make_plan(scene, spp=2, sampler="independent")


@pytest.mark.parametrize(("threads", "longest"), [(1, 1), (2, 1), (1, 3), (2, 8)])
def test_tiles_that_are_developed_at_once_are_those_of_the_film(
    threads, longest, plan_of_a_crop_window, monkeypatch
):
    """Strip by strip, in a row that is no multiple of a strip; interrupted, and gone on."""
    monkeypatch.setattr(finished_tiles, "STRIPS_OF_A_THREAD", 1)
    monkeypatch.setattr(finished_tiles, "MOST_BYTES", longest * 4 * 32 * 32 * 8)
    job = RenderJob(*plan_of_a_crop_window, RenderOptions(seed=5, threads=threads))
    whole, at_once = job.make_film(), job.make_film(keep_sums=False)
    assert run(job, whole).complete and whole.develop().any()
    strips = at_once.strips
    assert max(end - first for first, end in strips) == min(longest, 5)
    assert [k for first, end in strips for k in range(first, end)] == list(range(20))
    finish, begun = RenderJob.finish_tiles, []

    def interrupted_finish(self, film, strip, thread):
        finish(self, film, strip, thread)
        begun.append(strip)
        if len(begun) > 1:
            raise KeyboardInterrupt

    with monkeypatch.context() as context:
        context.setattr(RenderJob, "finish_tiles", interrupted_finish)
        assert not run(job, at_once).complete
    done = at_once.samples > 0
    assert 0 < done.sum() < 20
    expected = np.zeros_like(whole.develop())
    for number in np.flatnonzero(done):
        tile = whole.tile(number)
        x, y = tile.x - whole.x, tile.y - whole.y
        part = np.s_[y : y + tile.height, x : x + tile.width]
        expected[part] = whole.develop()[part]
    assert np.array_equal(at_once.develop(), expected)
    assert at_once.samples_done == 2 * at_once.pixels_of_place[done].sum()
    assert run(job, at_once).complete
    assert not at_once.sums.any()
    assert np.array_equal(at_once.develop(), whole.develop())


@pytest.mark.parametrize("method", ["path", "direct", "several", "whitted"])
def test_black_samples_have_their_places_too(method):
    """At depth 0, which traces nothing: the weights are those of depth 1, in each tile.

    Through a filter, which asks where a sample is: at a place that was never written it
    took memory for the film that was none.
    """
    film = {"type": "hdrfilm", "width": 40, "height": 70, "filter": {"type": "gaussian"}}
    several = {"type": "direct", "shading_samples": 2}
    content = {
        "type": "scene",
        "integrator": several if method == "several" else {"type": method},
        "sensor": {"type": "perspective", "film": film},
        "lamp": {"type": "sphere", "emitter": {"type": "area"}},
    }
    scene, sums = renderer.load_dict(content), []
    plan = make_plan(scene, spp=3, sampler="independent")
    for depth in (0, 1):
        plan = dataclasses.replace(plan, max_depth=depth)
        job = RenderJob(scene, plan, RenderOptions(seed=2, threads=1))
        film = job.make_film()
        assert run(job, film).complete
        sums.append(film.sums)
    assert not sums[0][:, :-1].any()
    assert np.array_equal(sums[0][:, -1], sums[1][:, -1])
    assert (sums[0][:, -1] > 0).any(axis=(1, 2)).sum() >= 6

"""An interrupted picture says how many samples it holds, wherever it says how many."""

from __future__ import annotations

import dataclasses
import re
import time
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

import renderer
from mitsuba_ref.false_alarms.renders_by_seed import by_ours
from mitsuba_ref.our_renderer import picture as our_picture
from mitsuba_ref.records.request import RenderRequest
from renderer.command import cli
from renderer.command.outputs import rate_line
from renderer.errors import ClusterError
from renderer.rendering import render as road
from renderer.rendering.job import RenderJob
from renderer.rendering.progress_display import Progress
from reports.trials.contenders import of_ours
from reports.trials.noiseless import has_noise
from reports.trials.simpler_scenes import Trial

SCENES = Path(__file__).parents[3] / "scenes"
CORNELL = SCENES / "cornell-box" / "scene.xml"
SIZE = 48  # pixels a side, which are four tiles of unequal size


@pytest.fixture(autouse=True)
def _without_kernels(monkeypatch):
    """Let each job take a moment, and add one sample to all of its tiles' sums."""

    def render(self, sums, tiles, first_sample, end_sample, thread):
        time.sleep(2e-4)
        sums += end_sample - first_sample
        sums[:, 0] += first_sample  # halves that differ have an error

    monkeypatch.setattr(RenderJob, "_render", render)


@pytest.fixture
def box():
    return renderer.load_file(CORNELL, width=SIZE, height=SIZE)


def stop_after(samples):
    """Return what interrupts a render as soon as so many samples are there."""

    def progress(now: Progress) -> None:
        if now.stage == "render" and now.done >= samples:
            raise KeyboardInterrupt

    return progress


def samples_said(image):
    """Return the samples that the metadata tell, which count them in all pixels."""
    return int(re.match(r"after (\d+)", image.metadata["interrupted"])[1])


def test_spp_is_what_the_pixels_hold_and_not_what_was_requested(box):
    """Tiles have come unequally far: their mean, times the pixels, is what was traced."""
    image = renderer.render(box, 1 << 16, threads=2, progress=stop_after(1))
    assert not image.complete
    assert 0 < image.spp * SIZE**2 == image.samples == samples_said(image)
    assert image.spp < 0.1 * image.requested_spp and image.requested_spp == 1 << 16


def test_a_picture_whose_tiles_are_finished_one_by_one_holds_a_part_of_a_sample(
    monkeypatch,
):
    """At one sample some tiles have it, and the others have none."""
    finish = RenderJob.finish_tiles

    def finish_one(self, film, strip, thread):
        finish(self, film, strip, thread)
        raise KeyboardInterrupt

    monkeypatch.setattr(RenderJob, "finish_tiles", finish_one)
    # so many tiles that each has sums of its own
    image = renderer.render(renderer.load_file(CORNELL, width=256, height=160), 1)
    assert not image.complete and 0 < image.spp < 1
    assert image.spp * 256 * 160 == image.samples == samples_said(image)


def test_nothing_at_all_is_no_sample(box):
    image = renderer.render(box, 64, progress=stop_after(0))
    assert (image.spp, image.samples, image.complete) == (0, 0, False)
    assert "interrupted: 0 of 64 samples per pixel" in repr(image)


def test_a_whole_picture_has_the_number_that_was_requested(box):
    image = renderer.render(box, 7)
    assert (image.spp, image.requested_spp, image.samples) == (7, 7, 7 * SIZE**2)
    assert isinstance(image.spp, int) and "48, 7 samples per pixel, " in repr(image)


@pytest.mark.parametrize(
    ("spp", "requested", "text"),
    [
        (3.1416, 64, "interrupted: about 3.1 of 64 samples per pixel"),
        (0.0321, 1, "interrupted: about 0.03 of 1 samples per pixel"),
        (131.07, 1 << 16, "interrupted: about 131.1 of 65536 samples per pixel"),
        (3, 64, "interrupted: 3 of 64 samples per pixel"),
        (3.5, None, "interrupted: about 3.5 samples per pixel"),
    ],
)
def test_the_words_in_a_console_and_in_a_notebook(spp, requested, text):
    image = renderer.Image(
        np.zeros((2, 3, 3), np.float32), spp=spp, requested_spp=requested, complete=False
    )
    assert f"<Image 3 x 2, {text}, 0.00 s>" == repr(image)
    assert text in image._repr_html_()


def test_the_header_of_a_file_has_the_same_number(box, tmp_path):
    """A whole number as before, and a fraction where there is one."""
    image = renderer.render(box, 1 << 16, threads=2, progress=stop_after(1))
    for name, each in {
        "whole": dataclasses.replace(image, spp=5, complete=True),
        "part": dataclasses.replace(image, spp=3.25),
    }.items():
        path = tmp_path / f"{name}.exr"
        each.save(path)
        with OpenEXR.File(str(path), header_only=True) as file:
            assert file.header()["spp"] == each.spp


def test_a_goal_that_was_not_reached(box):
    """There is no number that was requested; the line of `explain` has the true one."""
    image = renderer.render(box, target_error=1e-9, progress=stop_after(20 * SIZE**2))
    assert not image.complete and image.requested_spp is None
    assert image.spp * SIZE**2 == pytest.approx(samples_said(image)) == image.samples
    assert f"{image.spp:.1f}".removesuffix(".0") in image.explain.splitlines()[-1]
    assert " of " not in repr(image)


def test_frames_and_what_goes_on_from_a_checkpoint(box, tmp_path):
    """Of a resumed render the samples before it count too."""
    (image,) = renderer.render_frames(iter([box, box]), spp=1 << 16, progress=stop_after(1))
    assert image.spp * SIZE**2 == image.samples == samples_said(image)
    path, seen = tmp_path / "a.ckpt", []
    for resume in (False, True):
        image = renderer.render(
            box,
            4096,
            progress=stop_after(seen[-1].samples + 1 if resume else 1),
            checkpoint=path,
            resume=resume,
            threads=1,
        )
        seen.append(image)
        assert image.spp * SIZE**2 == pytest.approx(image.samples) == samples_said(image)
    assert seen[0].spp < seen[1].spp < 4096


def test_aovs_and_their_colours(monkeypatch):
    """`spp` is of the pixels, which are the colours; AOVs were traced before them."""
    scene = renderer.load_file(
        SCENES / "depth-and-normals" / "scene.xml", width=SIZE, height=SIZE
    )
    whole = renderer.render(scene, 4)
    assert (whole.spp, whole.samples) == (4, 2 * 4 * SIZE**2)
    starts = []

    def in_the_colours(now):
        if now.stage == "render" and now.done == 0:
            starts.append(now)
        if len(starts) == 2 and now.done > 0:
            raise KeyboardInterrupt

    image = renderer.render(scene, 1 << 12, progress=in_the_colours, threads=1)
    assert not image.complete and 0 < image.spp < image.requested_spp == 1 << 12
    assert image.samples == round(SIZE**2 * (image.spp + (1 << 12)))
    begin = road.begin

    def refusing(of, *arguments):
        if of is not scene:
            raise ClusterError("no worker")
        return begin(of, *arguments)

    monkeypatch.setattr(road, "begin", refusing)
    image = renderer.render(scene, 4)
    assert (image.spp, image.requested_spp, image.complete) == (0, 4, False)


def test_the_rate_is_of_samples_that_were_traced(box, tmp_path):
    """In bands too, and of AOVs both passes: `seconds` is the time of both."""
    scene = renderer.load_file(
        SCENES / "depth-and-normals" / "scene.xml", width=SIZE, height=SIZE
    )
    picture = renderer.render(scene, 4)
    file = renderer.render_to_file(scene, tmp_path / "a.exr", spp=4)
    assert picture.samples == file.samples == 8 * SIZE**2
    seconds = {"seconds": 1e-3, "spp": 3}
    for one in (picture, file):
        line = rate_line(dataclasses.replace(one, **seconds), "a.exr")
        assert f" {8 * SIZE**2 / 1e3:.1f} Msamples/s" in line


def test_the_command_in_a_file_is_one_that_can_be_run(box):
    """After an interrupt a goal has a fraction of samples, which --spp does not take."""
    image = renderer.render(box, target_error=1e-9, progress=stop_after(20 * SIZE**2))
    for spp, expected in ((image.spp, int(image.spp)), (0.25, 1)):
        part = dataclasses.replace(image, spp=spp, error=0.5)
        options = cli.read_options(["scene.xml"])
        command = cli.signed(part, options).metadata["command"]
        assert f"--spp {expected} --sampler independent" in command


def test_the_harness_takes_no_part_of_a_picture_for_a_whole_one(box, monkeypatch):
    """Ctrl-C ends a validation or a measurement; our picture so far would spoil it."""
    request = RenderRequest(path=str(CORNELL), parameters={"width": "16", "height": "16"})

    def render(*arguments, **choices):
        return renderer.Image(np.zeros((16, 16, 3), np.float32), spp=2.5, complete=False)

    monkeypatch.setattr(renderer, "render", render)
    trial = Trial(box, spp=4, seeds=2, tolerance=0.01, timed=0.0)
    for measured in (
        lambda: our_picture.render_ours(request),
        lambda: by_ours(CORNELL, {"width": "16"})(4, 0),
        lambda: of_ours(box, 1)(0, 4),
        lambda: has_noise(CORNELL, None),
        lambda: trial.render(box, 0),
    ):
        with pytest.raises(KeyboardInterrupt):
            measured()

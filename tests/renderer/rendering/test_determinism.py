"""The same scene and seed give the same picture, bit for bit, however it is computed.

Random numbers depend on pixel, sample and dimension alone, and all sums have a fixed order
(docs/conventions.md), so that a picture can be reproduced on another machine, with another
number of threads, or in parts.
"""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from small_scenes import box, diffuse, pixels, rectangle, scene, sensor

WIDTH, HEIGHT = 45, 37  # no multiple of a tile, four tiles
SAMPLES = 36  # more than one job for each tile


def noisy_box(**film):
    """Return a box with a lamp, where every kind of random number is drawn."""
    camera = sensor(
        (0, -0.95, 0.1),
        (0, 0.5, 0),
        fov=80,
        size=(WIDTH, HEIGHT),
        spp=film.pop("spp", SAMPLES),
        jitter=True,
        **film,
    )
    lamp = rectangle((0, 0, 0.99), (0.3, 0, 0), (0, -0.3, 0), diffuse(0.0), shine=8.0)
    return scene(camera, "path", *box((0.7, 0.5, 0.3)), lamp, max_depth=-1, rr_depth=3)


@pytest.fixture(scope="module")
def one_thread():
    return pixels(noisy_box(), threads=1)


@pytest.mark.parametrize("threads", [2, 5])
def test_threads_do_not_change_a_bit(one_thread, threads):
    np.testing.assert_array_equal(one_thread, pixels(noisy_box(), threads=threads))


def test_a_wide_filter_sums_in_a_fixed_order():
    """A gaussian adds the samples of a tile to its neighbours' pixels as well."""
    content = noisy_box(rfilter="gaussian", spp=4)
    first = pixels(content, threads=1)
    for threads in (2, 5):
        np.testing.assert_array_equal(first, pixels(content, threads=threads))


def test_the_seed_decides(one_thread):
    np.testing.assert_array_equal(one_thread, pixels(noisy_box(), seed=0))
    other = pixels(noisy_box(), seed=1)
    assert not np.array_equal(one_thread, other)
    assert (one_thread != other).mean() > 0.9  # everywhere, not here and there
    assert other.mean() == pytest.approx(one_thread.mean(), rel=0.05)


@pytest.mark.parametrize(
    "window",
    [(0, 0, 20, 10), (7, 5, 33, 32), (44, 36, 1, 1)],
    ids=["corner", "inside", "last"],
)
def test_a_crop_window_is_a_part_of_the_picture(one_thread, window):
    """The tiles of the crop lie elsewhere, but the pixels keep their random numbers."""
    x, y, width, height = window
    part = pixels(noisy_box(crop=window))
    assert part.shape == (height, width, 3)
    np.testing.assert_array_equal(part, one_thread[y : y + height, x : x + width])


def test_two_processes_give_the_same_bytes(one_thread):
    """Nothing depends on hash seeds, addresses or what was rendered before."""
    code = (
        f"import sys; sys.path[:0] = {sys.path!r}; "
        "import test_determinism as t; "
        "sys.stdout.buffer.write(t.pixels(t.noisy_box()).tobytes())"
    )
    output = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, check=True, timeout=300
    )
    assert output.stdout == one_thread.tobytes()

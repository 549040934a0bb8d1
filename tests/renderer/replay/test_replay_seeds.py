"""Which seed each pixel gets: Morton's curve, the spiral of blocks, and Mitsuba itself."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_ref.reference.variant import load_mitsuba
from renderer.replay.numbers import pcg32_seed
from renderer.replay.pixel_seeds import morton_number, pixel_seeds, spiral_numbers

MULTIPLIER, INCREMENT = 0x5851F42D4C957F2D, 0xDA3E39CB94B95BDB << 1 | 1


def float_and_next(state):
    """Return PCG32's next float and state, in Python's whole numbers."""
    shifted = (((state >> 18) ^ state) >> 27) & 0xFFFFFFFF
    turn = state >> 59
    bits = ((shifted >> turn) | (shifted << (-turn & 31))) & 0xFFFFFFFF
    return (bits >> 9) * 2.0**-23, (state * MULTIPLIER + INCREMENT) % 2**64


def test_morton_numbers_of_the_first_sixteen_pixels():
    """The curve is a Z of Zs: 0 1 4 5 / 2 3 6 7 / 8 9 12 13 / 10 11 14 15."""
    y, x = np.mgrid[:4, :4]
    assert morton_number(x, y).tolist() == [
        [0, 1, 4, 5],
        [2, 3, 6, 7],
        [8, 9, 12, 13],
        [10, 11, 14, 15],
    ]


def test_the_spiral_starts_in_the_middle_and_turns_right_down_left_up():
    """Worked by hand for 3 x 3; the middle of 3 is block 1."""
    assert spiral_numbers(3, 3).tolist() == [[6, 7, 8], [5, 0, 1], [4, 3, 2]]


@pytest.mark.parametrize(("columns", "rows"), [(1, 1), (1, 9), (9, 1), (2, 2), (7, 4)])
def test_every_block_has_a_number_of_its_own(columns, rows):
    """The spiral leaves a film that is not square and comes back; it must miss nothing."""
    numbers = spiral_numbers(columns, rows)
    assert sorted(numbers.ravel()) == list(range(columns * rows))


def test_seeds_of_one_block_follow_mortons_curve():
    """In a film of one block, seed 3 starts after 3 films."""
    seeds = pixel_seeds(4, 2, 3)
    assert (seeds - 24).tolist() == [[0, 1, 4, 5], [2, 3, 6, 7]]


def test_seeds_wrap_around_as_unsigned_numbers_of_32_bits_do():
    """The render's seed may be any number of 32 bits."""
    big = 2**32 - 1
    assert pixel_seeds(1, 1, big)[0, 0] == big
    assert pixel_seeds(2, 1, big).tolist() == [[2**32 - 2, 2**32 - 1]]


@pytest.mark.parametrize(("width", "height"), [(5, 3), (40, 33), (97, 70)])
def test_film_places_are_mitsubas(width, height):
    """Mitsuba's first camera ray of each pixel, seen as uv on a square, tells its place.

    The square fills the film exactly (orthogonal distance 1, field of view 90 degrees), so
    its uv is the place on the film. The first two numbers of the pixel's generator must be
    that place; float32 rounds it to a few millionths of the film.
    """
    mi = load_mitsuba()
    square = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale([1, 1, 1])}
    film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}}
    film["component_format"] = "float32"
    look = mi.ScalarTransform4f().look_at([0, 0, 1], [0, 0, 0], [0, 1, 0])
    sensor = {"type": "perspective", "fov": 90, "fov_axis": "x", "to_world": look}
    sensor |= {"film": film, "sampler": {"type": "independent", "sample_count": 1}}
    scene = mi.load_dict({"type": "scene", "square": square, "sensor": sensor})
    aov = mi.load_dict({"type": "aov", "aovs": "uv:uv", "block_size": 32})
    uv = np.array(mi.render(scene, integrator=aov, spp=1, seed=7))[..., -2:]

    states = pcg32_seed(pixel_seeds(width, height, 7))
    for y, x in [(0, 0), (height - 1, width - 1), (height // 2, width // 3), (1, 2)]:
        dx, state = float_and_next(int(states[y, x]))
        dy, _ = float_and_next(state)
        column = (x + dx) / width
        row = (height / 2 - (y + dy)) / width + 0.5  # pixels are square
        assert uv[y, x] == pytest.approx([column, row], abs=3e-6)

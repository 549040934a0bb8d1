"""Relations between two pictures: what must not change when the scene is written otherwise.

No reference is needed, so nothing can be shared with it by mistake (row 32 of the failure
modes). Relations that single precision keeps exactly are asserted bit by bit, with noise
or without: random numbers depend on pixel, sample and dimension alone.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from metamorphic_scenes import (
    SIZE,
    lamps,
    moved,
    scaled,
    shapes,
    still_life,
    turned,
)
from scipy.stats import ttest_ind
from small_scenes import diffuse, pixels, placed
from soups import SAME_EXAMPLES

import renderer

NOISY = 64
noise = pytest.mark.parametrize("noisy", [0, NOISY], ids=["whitted", "path"])


@pytest.fixture(scope="module")
def before():
    """The still life, without noise and with it."""
    return {noisy: pixels(still_life(noisy=noisy)) for noisy in (0, NOISY)}


# --------------------------------------------------------------------------- exactly


@noise
@pytest.mark.parametrize("exponent", [-20, -3, 1, 20])
def test_scale_by_a_power_of_two_changes_no_bit(before, noisy, exponent):
    """Geometry by s, intensities by s^2: 10^-6 to 10^6, as no length is absolute.

    Multiplying by 2^k commutes with every rounding. A fixed epsilon, near plane or
    threshold anywhere in the path of a ray would show here.
    """
    after = pixels(still_life(scaled(2.0**exponent), noisy=noisy))
    np.testing.assert_array_equal(after, before[noisy])


@noise
@pytest.mark.parametrize("power", [2.0, 0.25])
def test_twice_the_emission_is_twice_the_picture(before, noisy, power):
    """Light is linear, and a power of two exact: the noise doubles with the picture."""
    lights = lamps(np.eye(4), power=power, area=noisy > 0)
    after = pixels(still_life(lights=lights, noisy=noisy))
    np.testing.assert_array_equal(after, power * before[noisy])


@pytest.mark.parametrize("axis", [0, 2])
def test_half_a_turn_about_an_axis_changes_no_bit(before, axis):
    """Two signs change everywhere, and with them nothing that rounds."""
    world = -np.eye(4)
    world[axis, axis] = world[3, 3] = 1
    np.testing.assert_array_equal(pixels(still_life(world)), before[0])


@noise
def test_the_order_of_the_shapes_changes_no_bit(before, noisy):
    """Names, numbers and the tree are others, hits are not. One lamp: nothing to choose."""
    things = dict(reversed(shapes().items()))
    after = pixels(still_life(things=things, noisy=noisy))
    np.testing.assert_array_equal(after, before[noisy])


def test_the_order_of_faces_changes_no_bit(tmp_path):
    """A mesh of 12 faces, shuffled twice."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4)]
    quads.append((1, 5, 7, 3))
    faces = [(a, b, c) for a, b, c, d in quads] + [(a, c, d) for a, b, c, d in quads]
    pictures = []
    for k in range(3):
        order = np.random.default_rng(k).permutation(12) if k else np.arange(12)
        lines = [f"v {x} {y} {z}\n" for x, y, z in corners]
        lines += ["f {} {} {}\n".format(*(i + 1 for i in faces[j])) for j in order]
        path = tmp_path / f"{k}.obj"
        path.write_text("".join(lines))
        box = {"type": "obj", "filename": str(path)}
        things = shapes()
        things["box"] = things["box"] | box
        pictures.append(pixels(still_life(things=things)))
    for picture in pictures[1:]:
        np.testing.assert_array_equal(picture, pictures[0])


# ---------------------------------------------------------------------- to rounding


def assert_same(after, before, *, median, share=0.01):
    """Assert equality to rounding; a `share` of the pixels may lie at a discontinuity.

    Such a pixel's centre is within rounding of a silhouette or of a shadow's edge.
    """
    difference = np.abs(after.astype(float) - before) / np.maximum(before, 1e-3)
    assert np.median(difference) <= median
    assert np.mean((difference > 1e-3).any(axis=2)) <= share


@SAME_EXAMPLES
@given(
    axis=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda a: np.linalg.norm(a) > 0.1),
    degrees=st.floats(-180, 180),
    shift=st.tuples(*[st.floats(-3, 3)] * 3),
    scale=st.floats(1e-3, 1e3),
)
def test_any_similarity_leaves_the_picture(axis, degrees, shift, scale):
    """Turned, moved and scaled with its camera: the same to rounding.

    Float32 rounds each coordinate anew, so bits cannot agree; the median pixel may move by
    4 x 2^-23, and 1 % of the pixels, those at edges, by anything. Measured: 2 units, and at
    most 0.3 %.
    """
    world = scaled(scale) @ moved(*shift) @ turned(axis, degrees)
    assert_same(pixels(still_life(world)), pixels(still_life()), median=4 * 2.0**-23)


@pytest.mark.parametrize("far", [1e1, 1e2, 1e3])
def test_far_from_the_origin_the_error_is_that_of_the_coordinates(before, far):
    """Row 15: at distance T coordinates are multiples of T 2^-24, and so is the error.

    Mirror and glass magnify it; at 10^3 an eighth of the pixels sees that.
    """
    after = pixels(still_life(moved(far, -far, far / 2)))
    assert_same(after, before[0], median=far * 2.0**-23, share=far / 5000)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_mirrored_scene_gives_the_mirrored_picture(before, axis):
    """Left and right change places, handedness and all, whichever axis is turned around."""
    world = np.eye(4)
    world[axis, axis] = -1
    things = shapes()
    for name in ("mirror", "glass"):  # a mirroring to_world turns spheres inside out
        things[name]["flip_normals"] = True
    after = pixels(still_life(world, things=things))
    assert_same(after[:, ::-1], before[0], median=2.0**-23)


@pytest.mark.parametrize("parts", [2, 5])
def test_a_point_light_in_parts(before, parts):
    """Whitted samples every light: parts of it in one place add up to the whole."""
    part = lamps(np.eye(4), power=1 / parts)["lamp"]
    lights = {f"part{i}": dict(part) for i in range(parts)}
    after = pixels(still_life(lights=lights))
    np.testing.assert_allclose(after, before[0], rtol=parts * 2.0**-23, atol=0)


def instanced(world):
    """The still life with its shapes in a group, placed by one instance."""
    whole = still_life(world)
    group = {"type": "shapegroup", **shapes()}
    rest = {name: part for name, part in whole.items() if name not in shapes()}
    copy = {
        "type": "instance",
        "group": {"type": "ref", "id": "group"},
        "to_world": world,
    }
    return {"type": "scene", "group": group, **rest, "copy": copy}


@pytest.mark.slow
@pytest.mark.parametrize(
    "world", [np.eye(4), turned((1, 2, 3), 37) @ moved(1, 2, 0.5)], ids=["here", "moved"]
)
def test_an_instance_is_what_it_holds(world):
    """Grouped and flat agree; the offset of new rays is a little larger in an instance."""
    flat, grouped = pixels(still_life(world)), pixels(instanced(world))
    assert_same(grouped, flat, median=4 * 2.0**-23)


# ------------------------------------------------------------------------- with noise

SEEDS = 32
FALSE_ALARMS = 1e-3  # of each family of 48 tests below


def tiles(content, seeds):
    """Means of 8 x 8 tiles, one row for each seed: (seeds, tiles, channels)."""
    loaded = renderer.load_dict(content)
    n = SIZE // 8
    pictures = [renderer.render(loaded, seed=s, integrator="path").pixels for s in seeds]
    whole = np.array(pictures, float).reshape(len(pictures), n, 8, n, 8, 3)
    return whole.mean(axis=(2, 4)).reshape(len(pictures), n * n, 3)


def smallest_p(first, second):
    """Welch's t for each tile and channel; the smallest p, Sidak's correction applied."""
    p = ttest_ind(first, second, axis=0, equal_var=False).pvalue
    return -np.expm1(p.size * np.log1p(-np.nanmin(p)))


@pytest.fixture(scope="module")
def noisy_tiles():
    return tiles(still_life(noisy=NOISY), range(SEEDS))


def half_lamp(x):
    lamp = placed((0.5 + x, -0.5, 5), (0.5, 0, 0), (0, -1, 0))
    return lamps(np.eye(4), area=True)["lamp"] | {"to_world": lamp}


def same_but(name):
    """The noisy still life, written in another way."""
    whole = lamps(np.eye(4), area=True)
    weak = lamps(np.eye(4), area=True, power=0.5)["lamp"]
    never = weak | {"to_world": placed((0, 0, -50), (1, 0, 0), (0, 1, 0))}
    return {
        "turned": lambda: still_life(turned((1, 2, 3), 37), noisy=NOISY),
        "half a turn": lambda: still_life(np.diag([-1.0, -1, 1, 1]), noisy=NOISY),
        "two lamps of half the area": lambda: still_life(
            lights={"left": half_lamp(-0.5), "right": half_lamp(0.5)}, noisy=NOISY
        ),
        "a lamp that lights nothing": lambda: still_life(
            lights={**whole, "never": never}, noisy=NOISY
        ),
    }[name]()


@pytest.mark.parametrize(
    "name",
    ["turned", "half a turn", "two lamps of half the area", "a lamp that lights nothing"],
)
def test_noisy_pictures_keep_their_expectation(noisy_tiles, name):
    """Welch's test over 32 + 32 seeds for 16 tiles and 3 channels, false alarms 1e-3.

    Frames of sampling, choices of lights and their probabilities are others, so the noise
    is; what it is noise of is not. Standard errors of a tile: 0.3 % (0.1 to 1 %).
    """
    other = tiles(same_but(name), range(SEEDS, 2 * SEEDS))
    assert smallest_p(noisy_tiles, other) > FALSE_ALARMS


def test_the_noisy_comparison_would_see_a_change(noisy_tiles):
    """A lamp 2 % brighter, or a wall a little less blue, is found by the same test."""
    brighter = lamps(np.eye(4), power=1.02, area=True)
    things = shapes()
    things["wall"]["bsdf"] = diffuse(0.25, 0.5, 0.7)
    for content in (
        still_life(lights=brighter, noisy=NOISY),
        still_life(things=things, noisy=NOISY),
    ):
        assert smallest_p(noisy_tiles, tiles(content, range(SEEDS, 2 * SEEDS))) < 1e-6

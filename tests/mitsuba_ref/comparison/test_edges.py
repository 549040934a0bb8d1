"""The masks hold both sides of every edge of the reference, and nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np

from mitsuba_ref.metrics.edges import dilated, discontinuities, silhouettes

# each undoes itself
TURNS = (
    lambda picture: picture,
    lambda picture: picture[:, ::-1],
    lambda picture: picture[::-1],
    lambda picture: picture.swapaxes(0, 1),
    lambda picture: picture[::-1, ::-1].swapaxes(0, 1),
)


def flat_wall(height: int = 9, width: int = 11) -> dict[str, np.ndarray]:
    normal = np.zeros((height, width, 3), dtype=np.float32)
    normal[..., 2] = 1.0
    return {
        "shape_index": np.ones((height, width, 1), dtype=np.float32),
        "depth": np.full((height, width, 1), 5.0, dtype=np.float32),
        "geo_normal": normal,
    }


def columns(find: Any, values: Any) -> list[int]:
    """Return the columns that are masked in every row; none may be masked in part.

    The same must be found in the picture mirrored, upside down and turned: an edge is one
    from either side.
    """
    masks = [
        turn(find({kind: turn(v) for kind, v in values.items()}))
        if isinstance(values, dict)
        else turn(find(turn(values)))
        for turn in TURNS
    ]
    for mask in masks[1:]:
        np.testing.assert_array_equal(mask, masks[0])
    full = np.flatnonzero(masks[0].all(axis=0))
    np.testing.assert_array_equal(full, np.flatnonzero(masks[0].any(axis=0)))
    return full.tolist()


def test_a_wall_has_no_edge():
    assert not silhouettes(flat_wall()).any()


def test_another_shape_masks_both_sides():
    aovs = flat_wall()
    aovs["shape_index"][:, 5:] = 2.0
    assert columns(silhouettes, aovs) == [4, 5]


def test_a_step_in_depth_of_one_shape_is_an_outline():
    aovs = flat_wall()
    aovs["depth"][:, 5:] = 7.0
    assert columns(silhouettes, aovs) == [4, 5]


def test_the_sky_behind_an_object_is_an_outline_and_no_edge_in_itself():
    """A miss has depth 0 in Mitsuba: it must not count as near."""
    aovs = flat_wall()
    aovs["depth"][:, 5:] = 0.0
    assert columns(silhouettes, aovs) == [4, 5]


def test_a_crease_is_an_edge_and_a_gentle_curve_is_none():
    aovs = flat_wall()
    aovs["geo_normal"][:, 5:] = (1.0, 0.0, 0.0)
    assert columns(silhouettes, aovs) == [4, 5]
    angles = np.radians(np.linspace(0.0, 60.0, 11))
    aovs["geo_normal"][:] = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=-1)
    assert columns(silhouettes, aovs) == []


def test_a_shadow_edge_is_found_and_a_gradient_is_not():
    ramp = np.linspace(1.0, 2.0, 11)[None, :, None] * np.ones((9, 1, 3))
    assert columns(discontinuities, ramp) == []
    shadow = ramp.copy()
    shadow[:, 5:] *= 0.3
    assert columns(discontinuities, shadow) == [4, 5]


def test_noise_in_the_dark_is_no_edge():
    """1e-6 to 2e-6 is a factor of two, and nothing compared with a value of 1."""
    picture = np.full((9, 11, 3), 1e-6)
    picture[:, 6:] = 2e-6
    picture[0, 0] = 50.0
    assert not discontinuities(picture)[4:, 4:].any()


def test_dilation_grows_one_pixel_in_eight_directions():
    mask = np.zeros((5, 5), dtype=bool)
    mask[2, 2] = True
    assert dilated(mask).sum() == 9
    mask[:] = False
    mask[0, 0] = True
    assert dilated(mask).sum() == 4


def test_a_single_pixel_masks_all_eight_around_it():
    """Brighter or darker, in one channel; nearer, farther, or the sky; another shape."""
    around = np.zeros((9, 11), dtype=bool)
    around[3:6, 4:7] = True
    for channel in range(3):
        for value in (0.5, 2.0):
            picture = np.ones((9, 11, 3))
            picture[4, 5, channel] = value
            np.testing.assert_array_equal(discontinuities(picture), around)
    for kind, value in (
        ("depth", 4.0),
        ("depth", 6.0),
        ("depth", 0.0),
        ("shape_index", 0.0),
        ("shape_index", 2.0),
        ("geo_normal", -1.0),
    ):
        aovs = flat_wall()
        aovs[kind][4, 5, -1] = value
        np.testing.assert_array_equal(silhouettes(aovs), around, err_msg=f"{kind} {value}")


def test_jumps_are_relative_to_the_brighter_and_to_the_nearer_of_two():
    """20 % of the brighter, and a hundredth for the dark; 10 % of the nearer."""
    for value, is_edge in ((0.81, False), (0.77, True)):
        picture = np.ones((9, 11, 3))
        picture[:, 5:, 1] = value
        assert columns(discontinuities, picture) == [4, 5] * is_edge, value
    for depth, is_edge in ((5.45, False), (5.53, True)):
        aovs = flat_wall()
        aovs["depth"][:, 5:] = depth
        assert columns(silhouettes, aovs) == [4, 5] * is_edge, depth

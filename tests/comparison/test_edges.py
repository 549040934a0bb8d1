"""The masks hold both sides of every edge of the reference, and nothing else."""

from __future__ import annotations

import numpy as np

from mitsuba_ref.metrics.edges import dilated, discontinuities, silhouettes


def flat_wall(height: int = 9, width: int = 11) -> dict[str, np.ndarray]:
    normal = np.zeros((height, width, 3), dtype=np.float32)
    normal[..., 2] = 1.0
    return {
        "shape_index": np.ones((height, width, 1), dtype=np.float32),
        "depth": np.full((height, width, 1), 5.0, dtype=np.float32),
        "geo_normal": normal,
    }


def columns(mask: np.ndarray) -> list[int]:
    """Return the columns that are masked in every row; none may be masked in part."""
    full = np.flatnonzero(mask.all(axis=0))
    assert np.array_equal(full, np.flatnonzero(mask.any(axis=0)))
    return full.tolist()


def test_a_wall_has_no_edge():
    assert not silhouettes(flat_wall()).any()


def test_another_shape_masks_both_sides():
    aovs = flat_wall()
    aovs["shape_index"][:, 5:] = 2.0
    assert columns(silhouettes(aovs)) == [4, 5]


def test_a_step_in_depth_of_one_shape_is_an_outline():
    aovs = flat_wall()
    aovs["depth"][:, 5:] = 7.0
    assert columns(silhouettes(aovs)) == [4, 5]


def test_the_sky_behind_an_object_is_an_outline_and_no_edge_in_itself():
    """A miss has depth 0 in Mitsuba: it must not count as near."""
    aovs = flat_wall()
    aovs["depth"][:, 5:] = 0.0
    assert columns(silhouettes(aovs)) == [4, 5]


def test_a_crease_is_an_edge_and_a_gentle_curve_is_none():
    aovs = flat_wall()
    aovs["geo_normal"][:, 5:] = (1.0, 0.0, 0.0)
    assert columns(silhouettes(aovs)) == [4, 5]
    angles = np.radians(np.linspace(0.0, 60.0, 11))
    aovs["geo_normal"][:] = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=-1)
    assert not silhouettes(aovs).any()


def test_a_shadow_edge_is_found_and_a_gradient_is_not():
    ramp = np.linspace(1.0, 2.0, 11)[None, :, None] * np.ones((9, 1, 3))
    assert not discontinuities(ramp).any()
    shadow = ramp.copy()
    shadow[:, 5:] *= 0.3
    assert columns(discontinuities(shadow)) == [4, 5]


def test_noise_in_the_dark_is_no_edge():
    """1e-6 beside 2e-6 is a factor of two, and nothing to see beside a value of 1."""
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

"""Each metric against a value worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_ref.metrics import distances
from mitsuba_ref.metrics.tone_map import tone_map


def grey(value: float, size: int = 16) -> np.ndarray:
    return np.full((size, size, 3), value, dtype=np.float32)


def linear_for_display(value: float) -> float:
    """Return the linear value whose tone-mapped, sRGB-encoded value is `value` (> 0.04)."""
    reinhard = ((value + 0.055) / 1.055) ** 2.4
    return reinhard / (1.0 - reinhard)


def test_tone_map_of_one_is_srgb_of_one_half():
    """1 / (1 + 1) = 0.5, whose sRGB value is 0.735357; 0 stays 0, negative becomes 0."""
    mapped = tone_map(np.array([[[1.0, 0.0, -1.0]]]))
    np.testing.assert_allclose(mapped[0, 0], [0.7353569, 0.0, 0.0], atol=1e-7)


def test_tone_map_never_reaches_one():
    """A tone map that clips would hide differences between highlights."""
    low, high = tone_map(np.array([1e3, 1e5]))
    assert low < high < 1.0


def test_rmse_of_one_value_in_twelve():
    """One of 12 values differs by 6: sqrt(36 / 12) = sqrt(3)."""
    a, b = np.zeros((2, 2, 3)), np.zeros((2, 2, 3))
    a[0, 1, 2] = 6.0
    assert distances.rmse(a, b) == pytest.approx(math.sqrt(3.0))


def test_rmse_counts_only_the_masked_pixels():
    """With that pixel alone in the mask: sqrt(36 / 3)."""
    a, b = np.zeros((2, 2, 3)), np.zeros((2, 2, 3))
    a[0, 1, 2] = 6.0
    mask = np.array([[False, True], [False, False]])
    assert distances.rmse(a, b, mask) == pytest.approx(math.sqrt(12.0))
    assert distances.rmse(a, b, ~mask) == 0.0


def test_rmse_sums_in_double_precision():
    """float32 squares of 1e-6 against 1 would vanish; the difference is exact here."""
    a = grey(1.0).astype(np.float64) + 1e-6
    assert distances.rmse(a, grey(1.0)) == pytest.approx(1e-6, rel=1e-9)


def test_relative_rmse_is_scale_free():
    """Against 4, 4.4 is off by one tenth; black against black is equal."""
    assert distances.relative_rmse(grey(4.4), grey(4.0)) == pytest.approx(0.1, rel=1e-6)
    assert distances.relative_rmse(grey(0.0), grey(0.0)) == 0.0
    assert distances.relative_rmse(grey(1.0), grey(0.0)) == math.inf


def test_relative_mse_by_hand():
    """(3 - 1)^2 / (1 + 0.01), and 1 / 0.01 against black."""
    assert distances.relative_mse(grey(3.0), grey(1.0)) == pytest.approx(4.0 / 1.01)
    assert distances.relative_mse(grey(1.0), grey(0.0)) == pytest.approx(100.0)


def test_trimmed_rmse_drops_one_firefly_in_768_values():
    """0.1 % of 16 x 16 x 3 values is one value: the firefly goes, the rest stays."""
    a, b = grey(1.5), grey(1.0)
    a[3, 4, 1] = 1000.0
    assert distances.trimmed_rmse(a, b) == pytest.approx(0.5)


def test_tile_means_keep_a_smaller_rest():
    """A 3 x 3 picture in tiles of 2: four means, the last of one pixel."""
    image = np.arange(9.0).reshape(3, 3, 1)
    means = distances.tile_means(image, tile=2)[..., 0]
    np.testing.assert_allclose(means, [[2.0, 3.5], [6.5, 8.0]])


def test_tile_rmse_does_not_see_a_checkerboard():
    """+1 and -1 in turn have tile means of zero; a bias of 1 has not."""
    board = np.indices((16, 16)).sum(axis=0)[..., None] % 2 * 2.0 - 1.0
    assert distances.tile_rmse(board, np.zeros_like(board)) == 0.0
    assert distances.tile_rmse(grey(1.0), grey(0.0)) == 1.0


def test_mean_difference_is_signed_and_relative():
    assert distances.mean_difference(grey(0.99), grey(1.0)) == pytest.approx(
        -0.01, rel=1e-5
    )


def test_ssim_of_two_greys():
    """Without variance only the luminance term is left: (2ab + C) / (a^2 + b^2 + C)."""
    a, b, c = 0.5, 0.6, 0.01**2
    value = distances.ssim(grey(linear_for_display(a)), grey(linear_for_display(b)))
    assert value == pytest.approx((2 * a * b + c) / (a * a + b * b + c), abs=1e-6)


def test_ssim_is_unmeasured_below_its_window():
    assert distances.ssim(grey(1.0, size=10), grey(1.0, size=10)) is None


def test_ciede2000_of_two_greys():
    """Between greys only lightness differs: dL / S_L (Sharma, Wu, Dalal 2005).

    Linear 0.2 and 0.3 are Y = 1/6 and 3/13 after Reinhard: L* = 116 Y^(1/3) - 16.
    """
    l1, l2 = (116.0 * y ** (1.0 / 3.0) - 16.0 for y in (0.2 / 1.2, 0.3 / 1.3))
    from_50 = ((l1 + l2) / 2.0 - 50.0) ** 2
    expected = (l2 - l1) / (1.0 + 0.015 * from_50 / math.sqrt(20.0 + from_50))
    mean, worst = distances.ciede2000(grey(0.2), grey(0.3))
    assert mean == pytest.approx(expected, abs=2e-3)
    assert worst == pytest.approx(mean)


def test_flip_of_equal_and_of_opposite_pictures():
    """0 for equal, near 1 for black against white, in between for half of the picture."""
    black, white = grey(0.0, 32), grey(1e6, 32)
    half = black.copy()
    half[:16] = white[:16]
    assert distances.flip(white, white) == 0.0
    opposite = distances.flip(white, black)
    assert 0.9 < opposite <= 1.0
    assert 0.4 * opposite < distances.flip(half, black) < 0.7 * opposite


def test_pictures_of_different_size_are_refused():
    """Broadcasting would compare a picture with one row of another."""
    with pytest.raises(ValueError, match="different shape"):
        distances.rmse(grey(1.0, 4), grey(1.0, 5))

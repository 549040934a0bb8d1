"""Textures against Mitsuba's, at random (u, v) far outside of the unit square as well."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from PIL import Image
from scene_file_samples import mi

from renderer.jit import entry_kernel
from renderer.kinds.textures import eval_texture
from renderer.lanes.functions import first_lanes
from renderer.lanes.memory import load_row
from renderer.lanes.vectors import store3, vec3
from renderer.scene.materials import texture_rows
from renderer.scene_file.description import BitmapTexture, CheckerboardTexture

POINTS = 600


@entry_kernel
def run_eval_texture(textures, texture_of, material, uv, constant, out):
    for i in range(0, material.size, 16):
        plain = load_row(constant, 0, i)
        color = eval_texture(
            textures,
            texture_of,
            load_row(material, 0, i),
            load_row(uv, 0, i),
            load_row(uv, 1, i),
            vec3(plain, plain, plain),
            first_lanes(16),
        )
        store3(out, i, color)


def evaluate(textures, texture_of, material, uv, constant=0.25):
    """Colours (n, 3) of materials (n,) at uv (n, 2)."""
    n = len(material)
    pad = -n % 16
    material = np.pad(np.asarray(material, np.int32), (0, pad))
    uv = np.pad(np.asarray(uv, np.float32), ((0, pad), (0, 0))).T.copy()
    out = np.empty((3, n + pad), np.float32)
    plain = np.full(n + pad, constant, np.float32)
    run_eval_texture(
        texture_rows(textures), np.asarray(texture_of, np.int32), material, uv, plain, out
    )
    return out[:, :n].T


def colors(width, height):
    """Multiples of 1/255, which a PNG file holds exactly."""
    rng = np.random.default_rng(width * 100 + height)
    return rng.integers(0, 256, (height, width, 3)).astype(np.float32) / np.float32(255)


def affine(*rows):
    return np.array([*rows, (0, 0, 1)], float)


TO_UV = {
    "as it is": affine((1, 0, 0), (0, 1, 0)),
    "scaled": affine((3, 0, 0), (0, -2, 0)),
    "moved and turned": affine((0.6, -0.8, 0.25), (0.8, 0.6, -1.5)),
    "slanted": affine((1.5, 0.5, 0), (0, 0.7, 0.1)),
}
FILTERS, WRAPS, SIZES = (
    ("nearest", "bilinear"),
    ("repeat", "mirror", "clamp"),
    ((5, 3), (1, 1), (2, 7)),
)
BITMAPS = [
    (name, BitmapTexture(colors(*size), filter_type, wrap, TO_UV[name]))
    for filter_type, wrap, size, name in itertools.product(FILTERS, WRAPS, SIZES, TO_UV)
]
BOARDS = [
    (name, CheckerboardTexture((0.1, 0.2, 0.3), (0.7, 0.8, 0.9), TO_UV[name]))
    for name in TO_UV
]
ALL = [texture for _, texture in BITMAPS + BOARDS]


def in_mitsuba(texture, folder):
    """The same texture, from a file, whose top row Mitsuba has at v = 0."""
    to_uv = np.eye(4)
    to_uv[:2, :2], to_uv[:2, 3] = texture.to_uv[:2, :2], texture.to_uv[:2, 2]
    common = {"to_uv": mi.ScalarTransform4f(to_uv)}
    if isinstance(texture, CheckerboardTexture):
        rgb = {
            k: {"type": "rgb", "value": list(getattr(texture, k))}
            for k in ("color0", "color1")
        }
        return mi.load_dict({"type": "checkerboard", **rgb, **common})
    height, width = texture.pixels.shape[:2]
    path = folder / f"{width}x{height}.png"
    from_top = np.round(texture.pixels[::-1] * 255).astype(np.uint8)
    Image.fromarray(from_top).save(path)
    return mi.load_dict(
        {
            "type": "bitmap",
            "filename": str(path),
            "raw": True,
            "filter_type": texture.filter_type,
            "wrap_mode": texture.wrap_mode,
            **common,
        }
    )


def label(k):
    name, texture = (BITMAPS + BOARDS)[k]
    if isinstance(texture, CheckerboardTexture):
        return f"checkerboard {name}"
    height, width = texture.pixels.shape[:2]
    return f"{texture.filter_type} {texture.wrap_mode} {width}x{height} {name}"


@pytest.fixture(scope="module")
def picture():
    """All textures at the same points, evaluated together: (textures, points, 3)."""
    rng = np.random.default_rng(0)
    uv = rng.uniform(-3, 4, (POINTS, 2))
    uv[:50] = rng.uniform(0, 1, (50, 2))
    uv[50:100] = rng.uniform(-200, 200, (50, 2))
    uv = uv.astype(np.float32)
    material = np.repeat(np.arange(len(ALL)), POINTS)
    got = evaluate(ALL, np.arange(len(ALL)), material, np.tile(uv, (len(ALL), 1)))
    return uv, got.reshape(len(ALL), POINTS, 3)


@pytest.mark.parametrize("k", range(len(ALL)), ids=label)
def test_against_mitsuba(picture, tmp_path, k):
    """To the rounding of u (6e-5 of a texel at u = 200); 1 % may lie on a border."""
    uv, got = picture
    texture = in_mitsuba(ALL[k], tmp_path)
    si = mi.SurfaceInteraction3f()
    expected = []
    for u, v in uv.tolist():
        si.uv = (u, v)
        expected.append(list(texture.eval(si)))
    difference = np.abs(got[k] - np.array(expected)).max(axis=1)
    assert np.mean(difference > 2e-4) <= 0.01, np.sort(difference)[::-1][:8]


def test_the_comparison_sees_every_texel(picture):
    """Unmoved, repeated, nearest: all 15 texels of the 5 x 3 bitmap occur."""
    assert len(np.unique(picture[1][0], axis=0)) == 15


def test_a_bitmap_by_hand():
    """Row 0 of the description is at v near 1 (the reader turns files over)."""
    pixels = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 1]]], np.float32)
    nearest = BitmapTexture(pixels, "nearest", "clamp")
    smooth = BitmapTexture(pixels, "bilinear", "clamp")
    uv = [(0.25, 0.75), (0.75, 0.75), (0.25, 0.25), (0.75, 0.25)]
    for texture in (nearest, smooth):  # at the texels' centres both agree
        got = evaluate([texture], [0], [0] * 4, uv)
        np.testing.assert_allclose(got, pixels.reshape(4, 3), atol=1e-6)
    middle = evaluate([smooth], [0], [0], [(0.5, 0.5)])
    np.testing.assert_allclose(middle[0], pixels.mean(axis=(0, 1)), atol=1e-6)


def test_a_checkerboard_by_hand():
    board = CheckerboardTexture((1, 1, 1), (0, 0, 0))
    uv = [
        (0.25, 0.25),
        (0.75, 0.25),
        (0.25, 0.75),
        (0.75, 0.75),
        (-0.25, 0.75),
        (1.25, 7.25),
    ]
    got = evaluate([board], [0], [0] * 6, uv)[:, 0]
    np.testing.assert_array_equal(got, [1, 0, 0, 1, 1, 1])


def test_materials_without_a_texture_keep_their_constant():
    """In the same sixteen lanes as textured ones; ids are materials, not textures."""
    board = CheckerboardTexture((1, 1, 1), (1, 1, 1))
    texture_of = [-1, 0, -1]
    material = np.arange(40) % 3
    got = evaluate([board], texture_of, material, np.zeros((40, 2)))
    np.testing.assert_array_equal(got[:, 0], np.where(material == 1, 1.0, 0.25))


@pytest.mark.parametrize("bad", [1e9, -1e9, 3e38, np.inf, np.nan])
def test_absurd_uv_stay_inside_the_bitmap(bad):
    """Whatever colour comes out, no texel outside is read: all texels are 1."""
    for wrap in WRAPS:
        ones = BitmapTexture(np.ones((3, 5, 3), np.float32), "nearest", wrap)
        other = BitmapTexture(np.full((1, 1, 3), 9.0, np.float32), "nearest", wrap)
        got = evaluate([other, ones, other], [0, 1, 2], [1, 1], [(bad, 0.5), (0.5, bad)])
        np.testing.assert_array_equal(got, 1)

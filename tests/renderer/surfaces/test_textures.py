"""Textures against Mitsuba's, at random (u, v) far outside of the unit square as well."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pytest
from kernel_probes import Inputs, run_parameters
from PIL import Image
from scene_file_samples import mi

import renderer
from renderer.kernels.jit import pack
from renderer.plugins.bsdfs.registry import kind_of
from renderer.plugins.textures.registry import mean_of
from renderer.rendering.planning.make_plan import make_plan
from renderer.scene.materials import MaterialTables
from renderer.scene_file.description import (
    BitmapTexture,
    Blend,
    BumpMap,
    CheckerboardTexture,
    ConstantTexture,
    Dielectric,
    Diffuse,
    Mask,
    NormalMap,
)
from renderer.simple.textures import eval_number, eval_texture

POINTS = 600


PLATE = {
    "type": "scene",
    "camera": {"type": "perspective"},
    "plate": {"type": "rectangle"},
}


def evaluate(textures, texture_of, material, uv, constant=0.25, bsdf=Diffuse):
    """Colours (n, 3) of materials (n,) at uv (n, 2): diffuse ones with these textures.

    With `bsdf` Dielectric the numbers that these textures mean, in [:, 0].
    """
    n, plain = len(material), ConstantTexture((constant,) * 3)
    materials = [bsdf(textures[k] if k >= 0 else plain) for k in texture_of]
    scene = dataclasses.replace(
        renderer.load_dict(PLATE), materials=MaterialTables(materials)
    )
    inputs = Inputs(scene, make_plan(scene, integrator="path"))
    points = inputs.workspace(n).points
    points.bsdf[:n] = material
    points.uv[:, :n] = np.asarray(uv, np.float32).T
    run_parameters(pack(inputs.record.bsdfs), pack(points), n)
    return points.parameters[:3, :n].T


def rows_of(bsdf, material, uv):
    """Return the parameters by name, (rows, n), of BSDFs of one kind at uv (n, 2)."""
    n = len(material)
    scene = dataclasses.replace(renderer.load_dict(PLATE), materials=MaterialTables(bsdf))
    inputs = Inputs(scene, make_plan(scene, integrator="path"))
    points = inputs.workspace(n).points
    points.bsdf[:n] = material
    points.uv[:, :n] = np.asarray(uv, np.float32).T
    run_parameters(pack(inputs.record.bsdfs), pack(points), n)
    layout = kind_of(bsdf[0]).layout()
    return {name: points.parameters[at : at + count, :n] for name, at, count in layout}


def rgb(*components):
    return ConstantTexture(components)


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
    # four numbers that differ, so that none can stand in the place of another
    "turned, slanted and moved": affine((1.3, -0.6, 0.3), (0.4, 0.9, -0.7)),
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
    (name, CheckerboardTexture(rgb(0.1, 0.2, 0.3), rgb(0.7, 0.8, 0.9), TO_UV[name]))
    for name in TO_UV
]
ALL = [texture for _, texture in BITMAPS + BOARDS]


def transform(texture):
    to_uv = np.eye(4)
    to_uv[:2, :2], to_uv[:2, 3] = texture.to_uv[:2, :2], texture.to_uv[:2, 2]
    return mi.ScalarTransform4f(to_uv)


def in_mitsuba(texture, folder):
    """The same texture, from a file, whose top row Mitsuba has at v = 0."""
    common = {"to_uv": transform(texture)}
    if isinstance(texture, CheckerboardTexture):
        both = {
            k: {"type": "rgb", "value": list(getattr(texture, k).rgb)}
            for k in ("color0", "color1")
        }
        return mi.load_dict({"type": "checkerboard", **both, **common})
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
    """All textures at the same points: colours (textures, points, 3), numbers."""
    rng = np.random.default_rng(0)
    uv = rng.uniform(-3, 4, (POINTS, 2))
    uv[:50] = rng.uniform(0, 1, (50, 2))
    uv[50:100] = rng.uniform(-200, 200, (50, 2))
    uv = uv.astype(np.float32)
    material = np.repeat(np.arange(len(ALL)), POINTS)
    place = np.arange(len(ALL)), material, np.tile(uv, (len(ALL), 1))
    colors = evaluate(ALL, *place).reshape(len(ALL), POINTS, 3)
    numbers = evaluate(ALL, *place, bsdf=Dielectric)[:, 0].reshape(len(ALL), POINTS)
    return uv, np.concatenate([colors, numbers[..., None]], axis=2)


@pytest.mark.parametrize("k", range(len(ALL)), ids=label)
def test_against_mitsuba(picture, tmp_path, k):
    """To the rounding of u (6e-5 of a texel at u = 200); 1 % may lie on a border."""
    uv, got = picture
    texture = in_mitsuba(ALL[k], tmp_path)
    si = mi.SurfaceInteraction3f()
    expected = []
    for u, v in uv.tolist():
        si.uv = (u, v)
        expected.append([*texture.eval(si), texture.eval_1(si)])
    difference = np.abs(got[k] - np.array(expected)).max(axis=1)
    assert np.mean(difference > 2e-4) <= 0.01, np.sort(difference)[::-1][:8]


def test_points_on_edges_of_texels_have_those_of_mitsuba(tmp_path):
    """Where there are no u and v, as on an SDF, all points are at (0, 0), on an edge."""
    uv = np.array([(0, 0), (1, 1), (1, 0), (0, 1), (-1, 2), (0.5, 0.5)], np.float32)
    textures = [
        BitmapTexture(colors(2, 4), "nearest", wrap, TO_UV["as it is"]) for wrap in WRAPS
    ]
    material = np.repeat(np.arange(len(textures)), len(uv))
    place = np.arange(len(textures)), material, np.tile(uv, (len(textures), 1))
    got = evaluate(textures, *place).reshape(len(textures), len(uv), 3)
    si = mi.SurfaceInteraction3f()
    for texture, here in zip(textures, got, strict=True):
        reference, expected = in_mitsuba(texture, tmp_path), []
        for u, v in uv.tolist():
            si.uv = (u, v)
            expected.append(np.array(reference.eval(si)).ravel())
        np.testing.assert_allclose(here, expected, atol=1e-6, err_msg=texture.wrap_mode)


def test_slopes_are_those_of_mitsuba(tmp_path):
    """Of bump maps: all filters, wraps, sizes and maps of uv, at points all around.

    By both u and v, which a map that turns mixes: a slope by the wrong one shows.
    """
    rng = np.random.default_rng(4)
    n = 60
    uv = rng.uniform(-1, 2, (n, 2)).astype(np.float32)
    bumps = [BumpMap(texture, 1.0, True, True, Diffuse()) for _, texture in BITMAPS]
    material = np.repeat(np.arange(len(bumps)), n)
    got = rows_of(bumps, material, np.tile(uv, (len(bumps), 1)))["height"]
    got = got.reshape(2, len(bumps), n)
    si = mi.SurfaceInteraction3f()
    for k, (_, texture) in enumerate(BITMAPS):
        reference, expected = in_mitsuba(texture, tmp_path), []
        for u, v in uv.tolist():
            si.uv = (u, v)
            expected.append(np.array(reference.eval_1_grad(si)).ravel())
        difference = np.abs(got[:, k].T - expected).max(axis=1)
        # a slope jumps at the texels' centres
        off = np.mean(difference > 1e-3)
        assert off <= 0.02, f"{label(k)}: {off:.0%}, {np.sort(difference)[::-1][:4]}"
        if texture.filter_type == "bilinear" and texture.pixels.size > 3:
            assert np.abs(expected).max(axis=0).min() > 0.1, "a slope by u and one by v"


A, B, C = (
    BitmapTexture(colors(*size), "bilinear", wrap, TO_UV[name])
    for size, wrap, name in (
        ((5, 3), "repeat", "turned, slanted and moved"),
        ((4, 6), "mirror", "moved and turned"),
        ((3, 7), "clamp", "slanted"),
    )
)
BOARD_OF_ALL = CheckerboardTexture(
    rgb(0.1, 0.2, 0.3), rgb(0.9, 0.7, 0.4), TO_UV["turned, slanted and moved"]
)
WRAPPERS = {
    "mask": (Mask(A, Diffuse(B)), {"opacity": A, "nested.reflectance": B}),
    "mask of a board": (
        Mask(BOARD_OF_ALL, Diffuse(B)),
        {"opacity": BOARD_OF_ALL, "nested.reflectance": B},
    ),
    "blendbsdf": (
        Blend(A, Diffuse(B), Diffuse(C)),
        {"weight": A, "first.reflectance": B, "second.reflectance": C},
    ),
    "normalmap": (
        NormalMap(A, True, True, Diffuse(B)),
        {"normalmap": A, "nested.reflectance": B},
    ),
    "bumpmap": (
        BumpMap(A, 1.0, True, True, Diffuse(B)),
        {"height": A, "nested.reflectance": B},
    ),
    "two deep": (
        Mask(A, NormalMap(C, True, True, Diffuse(BOARD_OF_ALL))),
        {"opacity": A, "nested.normalmap": C, "nested.nested.reflectance": BOARD_OF_ALL},
    ),
}


@pytest.mark.parametrize("name", WRAPPERS)
def test_each_texture_of_a_wrapper_has_its_own_map_of_uv(tmp_path, name):
    """Its own, and those of what is inside: all different, and none along u and v."""
    bsdf, textures = WRAPPERS[name]
    uv = np.random.default_rng(12).uniform(-1, 2, (200, 2)).astype(np.float32)
    rows = rows_of([bsdf], np.zeros(200, np.int32), uv)
    si = mi.SurfaceInteraction3f()
    for parameter, texture in textures.items():
        reference, expected = in_mitsuba(texture, tmp_path), []
        got = rows[parameter]
        for u, v in uv.tolist():
            si.uv = (u, v)
            by_rows = {1: reference.eval_1, 3: reference.eval}
            value = (by_rows.get(len(got)) or reference.eval_1_grad)(si)
            expected.append(np.array(value, float).ravel())
        difference = np.abs(got.T - expected).max(axis=1)
        off = np.mean(difference > 1e-3)
        assert off <= 0.02, f"{parameter}: {off:.0%}, {np.sort(difference)[::-1][:4]}"


def test_the_comparison_sees_every_texel(picture):
    """Unmoved, repeated, nearest: all 15 texels of the 5 x 3 bitmap occur."""
    assert len(np.unique(picture[1][0], axis=0)) == 15


FOLDER = Path(__file__).parents[2] / "plugins" / "textures"
FILES = sorted(path for path in FOLDER.iterdir() if path.suffix != ".ply")
VARIANTS = list(itertools.product(FILTERS, WRAPS))


def test_every_format_against_mitsuba():
    """Each file with all filters and wraps, at 150 points, as a colour and as a number."""
    content, plugins = [], []
    for path, (filter_type, wrap) in itertools.product(FILES, VARIANTS):
        plugins.append(
            {
                "type": "bitmap",
                "filename": str(path),
                "filter_type": filter_type,
                "wrap_mode": wrap,
                "raw": wrap == "clamp",
                "to_uv": mi.ScalarTransform4f(TO_UV_3D),
            }
        )
        bsdf = {"type": "diffuse", "reflectance": plugins[-1]}
        content.append({"type": "rectangle", "bsdf": bsdf})
    scene = PLATE | {f"plate {k}": shape for k, shape in enumerate(content)}
    shapes = renderer.load_dict(scene).description.shapes[1:]
    textures = [shape.bsdf.reflectance for shape in shapes]
    formats = {(t.texels.dtype.name, t.texels.shape[2]) for t in textures}
    assert len(formats) == 6

    n = 150
    uv = np.random.default_rng(1).uniform(-2, 3, (n, 2)).astype(np.float32)
    place = np.arange(len(textures)), np.repeat(np.arange(len(textures)), n)
    uvs = np.tile(uv, (len(textures), 1))
    colors = evaluate(textures, *place, uvs).reshape(-1, n, 3)
    numbers = evaluate(textures, *place, uvs, bsdf=Dielectric)[:, 0].reshape(-1, n)
    si = mi.SurfaceInteraction3f()
    for plugin, color, number in zip(plugins, colors, numbers, strict=True):
        texture = mi.load_dict(plugin)
        expected = []
        for u, v in uv.tolist():
            si.uv = (u, v)
            expected.append([*texture.eval(si), texture.eval_1(si)])
        got = np.column_stack([color, number])
        difference = np.abs(got - expected).max(axis=1)
        assert np.mean(difference > 2e-5) <= 0.01, (plugin, np.sort(difference)[::-1][:5])


TO_UV_3D = np.eye(4)
TO_UV_3D[:2, :2], TO_UV_3D[:2, 3] = [[1.2, -0.5], [0.3, 0.8]], [0.1, -0.2]


@pytest.mark.parametrize("k", [0, 5, len(BITMAPS)], ids=label)
def test_mean_is_that_of_mitsuba(tmp_path, k):
    """A bitmap has that of its luminance, a checkerboard that of its six numbers."""
    expected = in_mitsuba(ALL[k], tmp_path).mean()
    assert mean_of(ALL[k]) == pytest.approx(expected, rel=1e-6)


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


def test_boards_of_boards():
    """The children see uv before `to_uv`; evaluated as a number, each board is swapped."""
    picture = BitmapTexture(colors(5, 3), "nearest", "repeat")
    inner = CheckerboardTexture(rgb(0.25, 0.5, 1), picture, TO_UV["scaled"])
    outer = CheckerboardTexture(inner, rgb(0, 0, 0.5), TO_UV["slanted"])
    uv = np.random.default_rng(3).uniform(-2, 2, (POINTS, 2)).astype(np.float32)
    got = evaluate([outer], [0], [0] * POINTS, uv)
    expected = [eval_texture(outer, *point) for point in uv.astype(float)]
    np.testing.assert_allclose(got, expected, atol=1e-6)
    assert len(np.unique(got, axis=0)) == 17

    texture = in_mitsuba_nested(inner, outer)
    numbers = evaluate([outer], [0], [0] * POINTS, uv, bsdf=Dielectric)[:, 0]
    si = mi.SurfaceInteraction3f()
    for (u, v), number in zip(uv.tolist(), numbers.tolist(), strict=True):
        si.uv = (u, v)
        assert texture.eval_1(si) == pytest.approx(number, abs=1e-6)
        assert eval_number(outer, u, v) == pytest.approx(number, abs=1e-6)
    assert mean_of(outer) == pytest.approx(texture.mean(), rel=1e-6)


def in_mitsuba_nested(inner, outer):
    picture = inner.color1
    return mi.load_dict(
        {
            "type": "checkerboard",
            "to_uv": transform(outer),
            "color0": {
                "type": "checkerboard",
                "to_uv": transform(inner),
                "color0": {"type": "rgb", "value": list(inner.color0.rgb)},
                "color1": {
                    "type": "bitmap",
                    "data": mi.TensorXf(np.ascontiguousarray(picture.pixels[::-1])),
                    "raw": True,
                    "filter_type": "nearest",
                },
            },
            "color1": {"type": "rgb", "value": list(outer.color1.rgb)},
        }
    )


def test_materials_without_a_texture_keep_their_constant():
    """In the same sixteen lanes as textured ones; ids are materials, not textures."""
    board = CheckerboardTexture(rgb(1, 1, 1), rgb(1, 1, 1))
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

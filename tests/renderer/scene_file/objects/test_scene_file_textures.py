"""Textures: the same texels as Mitsuba looks up, from every kind of image."""

from __future__ import annotations

from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from image_files import png_file, write_exr
from PIL import Image
from scene_file_samples import error_of, mitsuba_refuses, ours, theirs
from scene_xml import props, tag, to_uv

import renderer
from renderer.scene_file.description import BitmapTexture, CheckerboardTexture
from renderer.scene_file.images.image import linear_values
from renderer.scene_file.images.images import read_texels

SHAPE = (
    '<shape type="rectangle"><bsdf type="diffuse">\n'
    '<texture type="{}" name="reflectance">{}</texture></bsdf></shape>'
)
WIDTH, HEIGHT = 5, 4
RNG = np.random.default_rng(7)
BYTES = RNG.integers(0, 256, (HEIGHT, WIDTH, 4), dtype=np.uint8)
FLOATS = RNG.random((HEIGHT, WIDTH, 4), dtype=np.float32)


def write_png(path: Path, values: np.ndarray, *, interlaced: bool = False) -> None:
    """Write a 16-bit PNG whose rows use all five filters in turn."""
    height, width, channels = values.shape
    step = 2 * channels
    rows = values.astype(">u2").reshape(height, -1).view(np.uint8).astype(int)
    packed = b""
    above = np.zeros(rows.shape[1], int)
    for y, row in enumerate(rows):
        left = np.concatenate([np.zeros(step, int), row[:-step]])
        corner = np.concatenate([np.zeros(step, int), above[:-step]])
        near = np.abs(np.stack([above - corner, left - corner, left + above - 2 * corner]))
        paeth = np.choose(near.argmin(axis=0), [left, above, corner])
        guess = [0 * row, left, above, (left + above) // 2, paeth][y % 5]
        packed += bytes([y % 5]) + ((row - guess) % 256).astype(np.uint8).tobytes()
        above = row
    color_type = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    size, form = (width, height), (color_type, 16)
    path.write_bytes(png_file(size, form, packed, interlace=int(interlaced)))


def write_images(folder: Path) -> None:
    """Write the same pixels each time: pytest may ask for the folder more than once."""
    rng = np.random.default_rng(8)
    grey, red = BYTES[..., 0], BYTES[..., 1]
    Image.fromarray(grey).save(folder / "grey.png")
    Image.fromarray(np.dstack([grey, red]), "LA").save(folder / "grey_alpha.png")
    Image.fromarray(BYTES[..., :3]).save(folder / "rgb.png")
    Image.fromarray(BYTES).save(folder / "rgba.png")
    Image.fromarray(BYTES[..., :3]).quantize(8).save(folder / "palette.png")
    Image.fromarray(grey > 128).save(folder / "bits.png")
    Image.fromarray(BYTES[..., :3]).resize((16, 16)).save(folder / "rgb.jpg", quality=90)
    Image.fromarray(grey).resize((16, 16)).save(folder / "grey.jpg", quality=90)
    for ending in ("bmp", "tga"):
        Image.fromarray(BYTES[..., :3]).save(folder / f"rgb.{ending}")
        Image.fromarray(grey).save(folder / f"grey.{ending}")
    Image.fromarray(BYTES).save(folder / "rgba.tga", compression="tga_rle")
    mi.Bitmap(FLOATS[..., :3]).write(str(folder / "plain.hdr"))
    mi.Bitmap(rng.random((3, 200, 3), np.float32) * 9).write(str(folder / "packed.hdr"))
    words = rng.integers(0, 65536, (7, 6, 4))
    for name, channels in (("grey", 1), ("grey_alpha", 2), ("rgb", 3), ("rgba", 4)):
        write_png(folder / f"{name}_16.png", words[..., :channels])
    r, g, b, a = (FLOATS[..., k] for k in range(4))
    write_exr(folder / "rgb.exr", {"R": r, "G": g, "B": b})
    write_exr(folder / "rgba.exr", {"R": r, "G": g, "B": b, "A": a})
    write_exr(folder / "half.exr", {"RGB": FLOATS[..., :3].astype(np.float16)})
    write_exr(folder / "grey.exr", {"Y": r})
    write_exr(folder / "layer.exr", {"paint.R": r, "paint.G": g, "paint.B": b})
    xyz = {name: 0.9 + 0.01 * plane for name, plane in zip("XYZ", (r, g, b), strict=True)}
    write_exr(folder / "xyz.exr", xyz)


IMAGES = (
    *("grey.png", "grey_alpha.png", "rgb.png", "rgba.png", "palette.png", "bits.png"),
    *("rgb.jpg", "grey.jpg"),
    *("grey_16.png", "grey_alpha_16.png", "rgb_16.png", "rgba_16.png"),
    *("rgb.bmp", "grey.bmp", "rgb.tga", "grey.tga", "rgba.tga"),
    *("plain.hdr", "packed.hdr"),
    *("rgb.exr", "rgba.exr", "half.exr", "grey.exr", "layer.exr", "xyz.exr"),
)


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("images")
    write_images(folder)
    return folder


def bitmap(name: str, extra: str = "") -> str:
    return SHAPE.format("bitmap", f'<string name="filename" value="{name}"/>{extra}')


def texels(content: str, folder: Path, shape: tuple[int, ...]) -> np.ndarray:
    """Look up the centre of each texel in Mitsuba, in the order of our record.

    Its row 0 is at v near 1; Mitsuba has the top row of the file at v near 0.
    """
    bsdf = theirs(content, folder=folder).shapes()[0].bsdf()
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = [0, 0, 1]
    result = np.zeros((*shape[:2], 3))
    for row, column in np.ndindex(*shape[:2]):
        si.uv = [(column + 0.5) / shape[1], 1.0 - (row + 0.5) / shape[0]]
        result[row, column] = np.array(bsdf.eval_diffuse_reflectance(si))
    return result


@pytest.mark.parametrize("raw", ["false", "true"])
@pytest.mark.parametrize("name", IMAGES)
def test_texels_are_those_of_mitsuba(images: Path, name: str, raw: str) -> None:
    content = bitmap(
        name,
        f'<boolean name="raw" value="{raw}"/><string name="filter_type" value="nearest"/>',
    )
    texture = ours(content, folder=images).shapes[0].bsdf.reflectance
    assert isinstance(texture, BitmapTexture)
    assert texture.pixels.dtype == np.float32
    expected = texels(content, images, texture.pixels.shape)
    np.testing.assert_allclose(texture.pixels, expected, atol=2e-6)


@pytest.mark.parametrize("storage", ["auto", "variant", "fp16", "float16"])
@pytest.mark.parametrize("name", ["rgb.png", "rgb_16.png", "half.exr", "rgb.exr"])
def test_storage_format_rounds_as_in_mitsuba(images: Path, name: str, storage: str) -> None:
    content = bitmap(
        name,
        f'<string name="format" value="{storage}"/>'
        '<string name="filter_type" value="nearest"/>',
    )
    pixels = ours(content, folder=images).shapes[0].bsdf.reflectance.pixels
    np.testing.assert_allclose(pixels, texels(content, images, pixels.shape), atol=2e-6)


def test_every_16_bit_number_out_of_srgb(tmp_path: Path) -> None:
    """Mitsuba's power is approximate: 48 of 65536 halves are the neighbour of the nearest.

    Which ones are in a picture of random pixels decides whether it is equal: the suite met
    one that was not, once.
    """
    words = np.arange(65536).reshape(256, 256, 1)
    write_png(tmp_path / "words.png", words)
    image = mi.Bitmap(str(tmp_path / "words.png"))
    converted = image.convert(mi.Bitmap.PixelFormat.Y, mi.Struct.Type.Float16, False)
    expected = np.array(converted, np.float16)
    texels = read_texels(tmp_path / "words.png").texels
    np.testing.assert_array_equal(texels, words)
    found = linear_values(texels, srgb=True).astype(np.float16).reshape(expected.shape)
    steps = np.abs(found.view(np.int16) - expected.view(np.int16))
    assert steps.max() <= 1
    assert np.count_nonzero(steps) <= 60


KEPT_AS = (
    *(("rgb.png", np.uint8, 3), ("grey_alpha.png", np.uint8, 1), ("rgb.tga", np.uint8, 3)),
    *(("rgba_16.png", np.float16, 3), ("grey_16.png", np.float16, 1)),
    *(("half.exr", np.float16, 3), ("grey.exr", np.float32, 1)),
    *(("rgba.exr", np.float32, 3), ("packed.hdr", np.float32, 3)),
)


@pytest.mark.parametrize(("name", "dtype", "channels"), KEPT_AS)
def test_texels_are_kept_in_the_format_of_the_file(
    images: Path, name: str, dtype: type, channels: int
) -> None:
    texels = ours(bitmap(name), folder=images).shapes[0].bsdf.reflectance.texels
    assert (texels.dtype, texels.shape[2]) == (dtype, channels)


def test_bytes_only_where_there_are_bytes(images: Path) -> None:
    kept = props(format="uint8")
    texture = ours(bitmap("rgb.png", kept), folder=images).shapes[0].bsdf.reflectance
    assert texture.texels.dtype == np.uint8
    found = error_of(bitmap("rgb.exr", kept), folder=images)
    assert 'property "format": found "uint8" for texels of float32, expected auto' in found


def test_halves_that_are_too_small_for_the_pixels(tmp_path: Path) -> None:
    write_exr(tmp_path / "sun.exr", {"RGB": FLOATS[..., :3] * 1e6})
    found = error_of(bitmap("sun.exr", props(format="fp16")), folder=tmp_path)
    assert 'property "format": found half floats, expected variant: there are' in found


@pytest.mark.parametrize(
    ("name", "values", "srgb"),
    [
        ("data", FLOATS[..., :3], False),
        ("data", FLOATS[..., :1], False),
        ("bitmap", BYTES[..., :3], True),
        ("bitmap", BYTES, True),
        ("bitmap", FLOATS[..., :3].astype(np.float16), False),
        ("bitmap", RNG.integers(0, 65536, (HEIGHT, WIDTH, 3)).astype(np.uint16), False),
    ],
)
@pytest.mark.parametrize("raw", [False, True])
def test_pixels_in_a_dictionary(
    name: str, values: np.ndarray, srgb: bool, raw: bool
) -> None:
    """As NumPy arrays and as Mitsuba's own objects, which look them up alike."""
    theirs = mi.TensorXf(values) if name == "data" else mi.Bitmap(values)
    found = []
    for given in (values, theirs):
        texture = {"type": "bitmap", name: given, "raw": raw, "filter_type": "nearest"}
        bsdf = {"type": "diffuse", "reflectance": texture}
        scene = {"type": "scene", "camera": {"type": "perspective"}}
        scene["shape"] = {"type": "rectangle", "bsdf": bsdf}
        found.append(renderer.load_dict(scene).description.shapes[0].bsdf.reflectance)
    reference = mi.load_dict(
        {"type": "bitmap", name: theirs, "raw": raw, "filter_type": "nearest"}
    )
    si = dr.zeros(mi.SurfaceInteraction3f)
    for mine in found:
        assert mine.srgb == (srgb and not raw and mine.texels.dtype == np.uint8)
        for row, column in np.ndindex(HEIGHT, WIDTH):
            si.uv = [(column + 0.5) / WIDTH, (row + 0.5) / HEIGHT]
            expected = np.array(reference.eval(si))
            np.testing.assert_allclose(mine.pixels[::-1][row, column], expected, atol=2e-6)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.full((2, 2, 3), np.nan), "NaN or infinite pixels"),
        (
            np.full((2, 2, 3), -1.0),
            "negative mean (4 of 4 pixels are negative, down to -1)",
        ),
        (
            np.zeros((2, 2, 5)),
            "has the shape (2, 2, 5); expected (height, width, channels)",
        ),
        (np.zeros((0, 2, 3)), "has the shape (0, 2, 3)"),
        ("picture", 'property "data": found no image, expected an array'),
    ],
)
def test_pixels_in_a_dictionary_that_are_wrong(values: object, message: str) -> None:
    scene = {"type": "scene", "camera": {"type": "perspective"}}
    texture = {"type": "bitmap", "data": values}
    scene["shape"] = {
        "type": "rectangle",
        "bsdf": {"type": "diffuse", "reflectance": texture},
    }
    with pytest.raises(renderer.SceneError) as caught:
        renderer.load_dict(scene)
    assert "<dictionary> scene.shape.bsdf.reflectance" in str(caught.value)
    assert message in str(caught.value)


def test_defaults_and_choices_of_bitmaps(images: Path) -> None:
    texture = ours(bitmap("rgb.png"), folder=images).shapes[0].bsdf.reflectance
    assert (texture.filter_type, texture.wrap_mode) == ("bilinear", "repeat")
    np.testing.assert_array_equal(texture.to_uv, np.eye(3))
    for wrap in ("repeat", "mirror", "clamp"):
        content = bitmap("rgb.png", f'<string name="wrap_mode" value="{wrap}"/>')
        assert ours(content, folder=images).shapes[0].bsdf.reflectance.wrap_mode == wrap


def test_image_is_noted_as_read_and_read_once(images: Path) -> None:
    content = bitmap("rgb.png").replace("<texture", '<texture id="t"') + (
        '<shape type="disk"><bsdf type="diffuse"><ref id="t" '
        'name="reflectance"/></bsdf></shape>'
    )
    scene = ours(content, folder=images)
    assert scene.files == (str(images / "rgb.png"),)
    assert scene.shapes[0].bsdf.reflectance is scene.shapes[1].bsdf.reflectance


UV_STEPS = (
    '<scale x="2" y="3"/>',
    '<translate x="0.25" y="-2"/>',
    '<rotate z="1" angle="30"/><scale x="2" y="3" z="0"/><translate x=".2"/>',
    '<matrix value="1 2 9 4  5 6 9 8  9 9 9 9  0 0 0 1"/>',
    '<matrix value="1 2 0  4 5 0  0 0 1"/>',
)


@pytest.mark.parametrize("steps", UV_STEPS)
def test_uv_transform_is_that_of_mitsuba(images: Path, steps: str) -> None:
    to_uv = f'<transform name="to_uv">{steps}</transform>'
    for content in (bitmap("rgb.png", to_uv), SHAPE.format("checkerboard", to_uv)):
        texture = ours(content, folder=images).shapes[0].bsdf.reflectance
        reference = mi.traverse(theirs(content, folder=images).shapes()[0].bsdf())
        expected = np.array(reference["reflectance.to_uv"].matrix)
        np.testing.assert_allclose(texture.to_uv, expected, rtol=1e-6, atol=1e-6)


def test_third_column_of_a_uv_matrix_is_mentioned_in_the_log() -> None:
    """Whoever writes a 3 x 3 matrix means a shift, but Mitsuba reads it as part of 4 x "
    "4."""
    steps = '<transform name="to_uv"><matrix value="1 0 0.5  0 1 0  0 0 1"/></transform>'
    scene = ours(SHAPE.format("checkerboard", steps))
    assert "third column" in scene.warnings[0]
    np.testing.assert_array_equal(scene.shapes[0].bsdf.reflectance.to_uv, np.eye(3))


def test_checkerboard_has_the_colours_of_mitsuba() -> None:
    for content in ("", tag("rgb", color0="0.1 0.2 0.3") + tag("spectrum", color1="0.5")):
        text = SHAPE.format("checkerboard", content)
        texture = ours(text).shapes[0].bsdf.reflectance
        assert isinstance(texture, CheckerboardTexture)
        reference = mi.traverse(theirs(text).shapes()[0].bsdf())
        for name in ("color0", "color1"):
            expected = np.broadcast_to(reference[f"reflectance.{name}.value"], 3)
            np.testing.assert_allclose(getattr(texture, name).rgb, expected, rtol=1e-6)


def test_pixels_above_one_are_kept_and_mentioned_in_the_log(tmp_path: Path) -> None:
    """As in Mitsuba, which warns as well."""
    write_exr(tmp_path / "bright.exr", {"RGB": FLOATS[..., :3] * 3})
    scene = ours(bitmap("bright.exr"), folder=tmp_path)
    assert "reflectances up to 2.9" in scene.warnings[0]
    assert scene.shapes[0].bsdf.reflectance.pixels.max() > 2.9


# -------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (props(filter_type="trilinear"), "expected one of bilinear, nearest"),
        (props(wrap_mode="black"), "expected one of repeat, mirror, clamp"),
        (props(gamma=2.0), 'has no property "gamma"; supported: filename, raw'),
        (props(raw="true"), "a value of type string, expected boolean"),
        (props(to_uv=2.0), "a value of type float, expected transform"),
    ],
)
def test_bitmap_properties_that_are_wrong(images: Path, extra: str, message: str) -> None:
    content = bitmap("rgb.png", extra)
    found = error_of(content, folder=images)
    assert found.startswith('<string>:3: texture "bitmap"')
    assert message in found
    assert mitsuba_refuses(content, folder=images)


def test_singular_uv_transform() -> None:
    text = SHAPE.format("checkerboard", to_uv('<scale x="0"/>'))
    assert 'property "to_uv": found a singular transform of u and v' in error_of(text)


def test_bitmap_without_file_and_missing_file(tmp_path: Path) -> None:
    message = error_of(SHAPE.format("bitmap", ""))
    assert message.startswith(
        '<string>:3: texture "bitmap", property "filename": found nothing'
    )
    message = error_of(bitmap("gone.png"), folder=tmp_path)
    assert message.startswith('<string>:3: the image "gone.png" not found; looked in: ')
    assert str(tmp_path) in message
    (tmp_path / "dir.png").mkdir()
    assert "is not a file" in error_of(bitmap("dir.png"), folder=tmp_path)


@pytest.mark.parametrize(
    "name",
    [
        *("rgb.png", "rgb.jpg", "rgb_16.png", "rgb.exr"),
        *("rgb.bmp", "rgb.tga", "plain.hdr", "packed.hdr"),
    ],
)
@pytest.mark.parametrize("kept", [0.0, 0.05, 0.5])
def test_truncated_image(images: Path, tmp_path: Path, name: str, kept: float) -> None:
    content = (images / name).read_bytes()
    (tmp_path / name).write_bytes(content[: int(kept * len(content))])
    message = error_of(bitmap(name), folder=tmp_path)
    assert message.startswith('<string>:3: texture "bitmap": ')
    assert name in message


@pytest.mark.parametrize("name", ["rgb.exr", "plain.hdr", "packed.hdr"])
def test_image_without_its_last_byte(images: Path, tmp_path: Path, name: str) -> None:
    """Of formats that end with pixels; what may follow them in others is not needed."""
    (tmp_path / name).write_bytes((images / name).read_bytes()[:-1])
    assert name in error_of(bitmap(name), folder=tmp_path)


@pytest.mark.parametrize(
    ("pixels", "message"),
    [
        (np.nan, "NaN or infinite pixels, 1 of 20; the first is in row 1, column 2"),
        (np.inf, "NaN"),
        (-500.0, "bad.exr with a negative mean (1 of 20 pixels"),
    ],
)
def test_image_with_values_that_are_no_reflectance(
    tmp_path: Path, pixels: float, message: str
) -> None:
    values = FLOATS[..., :3].copy()
    values[1, 2, 0] = pixels
    write_exr(tmp_path / "bad.exr", {"RGB": values})
    assert message in error_of(bitmap("bad.exr"), folder=tmp_path)


RGBE = b"#?RADIANCE\n# made by hand\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"#?RADIANCE\nFORMAT=32-bit_rle_luve\n\n-Y 1 +X 1\n....", "32-bit_rle_luve"),
        (RGBE + b"+X 1 -Y 1\n....", "no size `-Y HEIGHT +X WIDTH`"),
        (RGBE + b"-Y 1 +X\n....", "no size"),
        (RGBE[:-1], "its header does not end"),
        (RGBE + b"-Y 0 +X 5\n", "5 x 0 pixels; expected at least 1"),
        (RGBE + b"-Y 9999999 +X 9999999\n....", "9999999 x 9999999 pixels; expected"),
        (RGBE + b"-Y 30000 +X 8000\n" + b"\2\2" * 99, "198 bytes for 30000 rows"),
        (RGBE + b"-Y 2 +X 1\n....", "4 bytes for 2 rows of 1 pixels"),
        (RGBE + b"-Y 9 +X 9\nabcd\1\1\1\x50", "or one with runs of the old kind: 8 bytes"),
        (RGBE + b"-Y 1 +X 8\n\2\2\0\10" + b"\211a" * 4, "row 0 cannot be unpacked"),
        (RGBE + b"-Y 1 +X 8\n\2\2\0\10" + b"\0a" * 4, "row 0 cannot be unpacked"),
        (RGBE + b"-Y 1 +X 8\n\2\2\0\10\210a\210b\210c\5a", "row 0 cannot be unpacked"),
    ],
)
def test_radiance_pictures_that_are_damaged(
    tmp_path: Path, content: bytes, message: str
) -> None:
    """Too long or empty runs, sizes that promise more than there is, other layouts."""
    (tmp_path / "bad.hdr").write_bytes(content)
    found = error_of(bitmap("bad.hdr"), folder=tmp_path)
    assert found.startswith('<string>:3: texture "bitmap": ')
    assert message in found


@pytest.mark.parametrize(
    ("header", "kind", "channels"),
    [
        (b"PF\n5 4\n-1.0\n", "<f4", 3),
        (b"PF\n5 4\n1\n", ">f4", 3),
        (b"PF 5 4 -2.50e+00 ", "<f4", 3),
        (b"Pf\n5 4\n-1\n", "<f4", 1),
    ],
)
def test_float_maps_are_those_of_mitsuba(
    tmp_path: Path, header: bytes, kind: str, channels: int
) -> None:
    """Either order of bytes, a factor, one channel or three."""
    path = tmp_path / "map.pfm"
    path.write_bytes(header + FLOATS[..., :channels].astype(kind).tobytes())
    expected = np.array(mi.Bitmap(str(path))).reshape(HEIGHT, WIDTH, channels)
    np.testing.assert_array_equal(read_texels(path).texels, expected)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"PF\n5 4\n", "damaged PFM file: expected PF or Pf, width, height and a factor"),
        (b"PF\n5 4\n0.0\n" + bytes(240), "the factor is 0.0; expected a number other"),
        (b"PF\n5 4\n1.2.3\n" + bytes(240), "the factor is 1.2.3; expected a number other"),
        (b"PF\n5 4\n-1\n" + bytes(239), "damaged PFM file: 239 bytes for 5 x 4 pixels"),
        (b"PF\n0 4\n-1\n", "0 x 4 pixels; expected at least 1"),
        (b"Pf\n1 1\n-1\n\0\0\xc0\xff", "NaN or infinite pixels"),
    ],
)
def test_broken_float_maps(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "bad.pfm").write_bytes(content)
    found = error_of(bitmap("bad.pfm"), folder=tmp_path)
    assert found.startswith('<string>:3: texture "bitmap": ')
    assert message in found


def test_images_that_are_not_supported(images: Path, tmp_path: Path) -> None:
    (tmp_path / "text.png").write_text("not an image")
    Image.fromarray(BYTES[..., :3]).convert("CMYK").save(tmp_path / "cmyk.jpg")
    Image.fromarray(BYTES[..., :3]).save(tmp_path / "rgb.gif")
    write_png(tmp_path / "interlaced.png", RNG.integers(0, 9, (4, 4, 3)), interlaced=True)
    write_exr(tmp_path / "depth.exr", {"Z": FLOATS[..., 0]})
    for name, message in (
        ("text.png", "no image of a format that is read: PNG, JPEG, BMP, TGA, EXR"),
        ("rgb.gif", "no image of a format that is read: PNG, JPEG, BMP, TGA, EXR"),
        ("cmyk.jpg", "images of mode CMYK are not supported; supported: grey"),
        ("interlaced.png", "interlaced 16-bit PNG is not supported"),
        ("depth.exr", "the EXR file has the channels Z; expected R, G, B or Y or X, Y, Z"),
    ):
        assert message in error_of(bitmap(name), folder=tmp_path)

"""What image files say about their numbers: done as in Mitsuba, or named in the log."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import OpenEXR
import pytest
from image_files import chunk, png_file, write_exr
from PIL import Image, ImageCms
from scene_file_samples import error_of, ours

import renderer

WIDTH, HEIGHT = 5, 4
RNG = np.random.default_rng(11)
CHANNELS = {name: RNG.random((HEIGHT, WIDTH), np.float32) for name in "RGBAXYZ"}
BYTES = RNG.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
XYZ = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3)
AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
P3 = (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290)
BT709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)


def colors(names: str = "RGB", kind: str = "f4", prefix: str = "") -> dict[str, np.ndarray]:
    return {prefix + name: CHANNELS[name.upper()].astype(kind) for name in names}


def bitmap(path: Path, more: str = "") -> str:
    return (
        '<shape type="rectangle"><bsdf type="diffuse"><texture type="bitmap" '
        f'name="reflectance"><string name="filename" value="{path.name}"/>{more}'
        "</texture></bsdf></shape>"
    )


RAW = '<boolean name="raw" value="true"/>'


def read(path: Path, more: str = "") -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the pixels of a texture, top row first, and the warnings."""
    scene = ours(bitmap(path, more), folder=path.parent)
    return scene.shapes[0].bsdf.reflectance.pixels[::-1], scene.warnings


def mitsubas(path: Path, **more: Any) -> np.ndarray:
    """Return the pixels of Mitsuba's texture as linear RGB, (H, W, 3)."""
    texture = mi.load_dict({"type": "bitmap", "filename": str(path), **more})
    texels = np.array(mi.traverse(texture)["data"])
    if texels.dtype == np.uint8:  # decoded where it is looked up
        texels = texels / np.float32(255.0)
        if not more.get("raw"):
            curve = ((texels + 0.055) / 1.055) ** 2.4
            texels = np.where(texels <= 0.04045, texels / 12.92, curve)
    return np.broadcast_to(texels, (*texels.shape[:2], 3)).astype(np.float32)


# -------------------------------------------------------------------------- OpenEXR


@pytest.mark.parametrize("raw", [False, True])
@pytest.mark.parametrize("kind", ["f2", "f4"])
@pytest.mark.parametrize("names", ["RGB", "RGBA", "Y", "YA", "XYZ", "XYZA"])
@pytest.mark.parametrize("points", [BT709, XYZ, AP0, P3], ids=["709", "xyz", "ap0", "p3"])
def test_chromaticities_mean_what_they_mean_in_mitsuba(
    tmp_path: Path, points: tuple[float, ...], names: str, kind: str, raw: bool
) -> None:
    """Of RGB; other channels are what their names say. Raw pixels are converted too."""
    path = write_exr(tmp_path / "a.exr", colors(names, kind), chromaticities=points)
    found, warnings = read(path, RAW if raw else "")
    expected = mitsubas(path, raw=raw)
    if names[:3] == "RGB" and points is not BT709:
        plain = write_exr(tmp_path / "plain.exr", colors(names, kind))
        assert np.abs(mitsubas(plain) - expected).max() > 0.02
    close = 2e-3 if kind == "f2" else 2e-6
    np.testing.assert_allclose(found, expected, atol=close)
    assert not any("not applied" in line for line in warnings)


def test_chromaticities_of_an_environment(tmp_path: Path) -> None:
    path = write_exr(tmp_path / "a.exr", colors(), chromaticities=P3)
    text = f'<emitter type="envmap"><string name="filename" value="{path.name}"/></emitter>'
    found = ours(text, folder=tmp_path).emitters[0].pixels
    sky = mi.load_dict({"type": "envmap", "filename": str(path)})
    expected = np.array(mi.traverse(sky)["data"])[:, 1:-1]  # a column more on each side
    np.testing.assert_allclose(found, expected, atol=2e-6)


@pytest.mark.parametrize("points", [(0.3,) * 8, (0.0,) * 8, (float("nan"),) * 8])
def test_chromaticities_of_no_colour_space(
    tmp_path: Path, points: tuple[float, ...]
) -> None:
    """Mitsuba's pixels are NaN."""
    path = write_exr(tmp_path / "a.exr", colors(), chromaticities=points)
    assert np.isnan(mitsubas(path)).all()
    assert "EXR attribute chromaticities" in error_of(bitmap(path), folder=tmp_path)


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        ({"whiteLuminance": 100.0}, "whiteLuminance (100) is not applied, as in Mitsuba"),
        ({"adoptedNeutral": np.float32([0.5, 0.25])}, "adoptedNeutral (0.5, 0.25) is"),
        ({"renderingTransform": "ACES"}, "renderingTransform (ACES) is not applied"),
        ({"colorInteropID": "lin_ap1_scene"}, "colorInteropID (lin_ap1_scene) is not"),
        ({"oiio:ColorSpace": "sRGB"}, "oiio:ColorSpace (sRGB) is not applied"),
        ({"oiio:ColorSpace": "\x1b[2J\n"}, "oiio:ColorSpace (\\x1b[2J\\x0a) is not"),
        ({"lookModTransform": "x", "chromaticities": BT709}, "lookModTransform (x) is not"),
        ({"oiio:ColorSpace": "ACEScg", "chromaticities": BT709}, ""),
        ({"pixelAspectRatio": 2.0}, "pixelAspectRatio (2) is not applied"),
        ({"envmap": 1}, "envmap says that it shows the faces of a cube"),
        ({"displayWindow": ((0, 0), (9, 9))}, "displayWindow is not the dataWindow"),
        ({"oiio:ColorSpace": "Linear", "envmap": 0, "owner": "me", "whiteLevel": 3}, ""),
    ],
)
def test_attributes_that_are_not_applied_are_named(
    tmp_path: Path, attributes: dict[str, Any], words: str
) -> None:
    """The pixels are those of Mitsuba, which is as silent about them as about the rest."""
    path = write_exr(tmp_path / "a.exr", colors(), **attributes)
    found, warnings = read(path)
    np.testing.assert_array_equal(found, mitsubas(path))
    assert len(warnings) == bool(words)
    assert not words or (words in warnings[0] and "a.exr: " in warnings[0])


@pytest.mark.parametrize(
    "channels",
    [
        *(colors("rgb"), colors("y"), colors("RGBa"), colors("Y", prefix="l.")),
        *(colors("RGB", prefix="l."), colors("rgb", prefix="a.b.")),
        {**colors("RGB"), **colors("A", "f2")},
        {**colors("RG"), **colors("B", "f2")},
        {**colors("BG"), **colors("R", "f2")},
        {**colors("RGB", "f2"), **colors("A")},
        {name: np.arange(20, dtype="u4").reshape(4, 5) for name in "RGB"},
    ],
    ids=lambda channels: ",".join(f"{k}{v.dtype.str[1:]}" for k, v in channels.items()),
)
def test_names_and_types_of_channels_mean_the_same(
    tmp_path: Path, channels: dict[str, np.ndarray]
) -> None:
    """Capital or small, of a layer; the first channel's type is that of all of them."""
    path = write_exr(tmp_path / "a.exr", channels)
    texture = mi.load_dict({"type": "bitmap", "filename": str(path)})
    expected = np.array(mi.traverse(texture)["data"])
    mine = ours(bitmap(path), folder=tmp_path).shapes[0].bsdf.reflectance
    assert mine.texels.dtype == expected.dtype
    np.testing.assert_array_equal(mine.texels[::-1], expected)


@pytest.mark.parametrize("names", ["rgba", "ya", "xyz", "xyza"])
def test_small_letters_are_read_where_mitsuba_stops(tmp_path: Path, names: str) -> None:
    """Which is wherever it has to convert them."""
    small = write_exr(tmp_path / "small.exr", colors(names))
    large = write_exr(tmp_path / "large.exr", colors(names.upper()))
    with pytest.raises(RuntimeError, match=r"channel|could not be found"):
        mitsubas(small)
    np.testing.assert_array_equal(read(small)[0], read(large)[0])


@pytest.mark.parametrize(
    "channels",
    [
        *(colors("R"), colors("Z"), colors("A"), colors("RG"), colors("RGBZ")),
        {"l.R": CHANNELS["R"], **colors("GB")},
        {"r": CHANNELS["R"], **colors("RGB")},
        {**colors("RGB"), "A": np.ones((HEIGHT, WIDTH), np.uint32)},
        {"Y": CHANNELS["Y"], "RY": CHANNELS["R"], "BY": CHANNELS["B"]},
    ],
    ids=lambda channels: ",".join(channels),
)
def test_channels_that_are_no_colours(
    tmp_path: Path, channels: dict[str, np.ndarray]
) -> None:
    """Among them two that Mitsuba reads as other colours than they are."""
    path = write_exr(tmp_path / "a.exr", channels)
    message = error_of(bitmap(path), folder=tmp_path)
    assert "a.exr: the " in message and "; expected " in message


def test_whole_numbers_of_other_primaries(tmp_path: Path) -> None:
    """Mitsuba multiplies them by themselves."""
    whole = {name: np.arange(20, dtype="u4").reshape(4, 5) for name in "RGB"}
    path = write_exr(tmp_path / "a.exr", whole, chromaticities=P3)
    assert "whole numbers and chromaticities" in error_of(bitmap(path), folder=tmp_path)


def test_the_first_of_several_parts(tmp_path: Path) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    parts = [
        OpenEXR.Part(dict(header), colors(), "beauty"),
        OpenEXR.Part(dict(header), colors("XYZ"), "other"),
    ]
    path = tmp_path / "a.exr"
    with OpenEXR.File(parts) as file:
        file.write(str(path))
    found, warnings = read(path)
    np.testing.assert_array_equal(found, np.dstack([CHANNELS[name] for name in "RGB"]))
    assert len(warnings) == 1 and "the EXR file has 2 parts; the first is" in warnings[0]


# ------------------------------------------------------------------------ PNG and JPEG


def png(path: Path, *chunks: bytes, depth: int = 8) -> Path:
    """Write a PNG with more chunks behind its header."""
    values = BYTES if depth == 8 else BYTES.astype(">u2") * 257
    rows = b"".join(b"\0" + row.tobytes() for row in values)
    path.write_bytes(png_file((WIDTH, HEIGHT), (2, depth), rows, *chunks))
    return path


def profile_chunk(profile: bytes, name: bytes = b"mine") -> bytes:
    return chunk(b"iCCP", name + b"\0\0" + zlib.compress(profile))


def icc(power: float, primaries: np.ndarray | None = None) -> bytes:
    """Return a profile of three primaries (rows, XYZ under D50) and a power."""
    if primaries is None:
        primaries = np.array(
            [[0.4361, 0.2225, 0.0139], [0.3851, 0.7169, 0.0971], [0.1431, 0.0606, 0.7141]]
        )
    curve = b"para" + bytes(8) + struct.pack(">i", round(power * 65536))
    tags = {b"%cTRC" % letter: curve for letter in b"rgb"}
    for letter, row in zip(b"rgb", primaries, strict=True):
        numbers = [round(number * 65536) for number in row]
        tags[b"%cXYZ" % letter] = b"XYZ " + bytes(4) + struct.pack(">3i", *numbers)
    table, data = struct.pack(">I", len(tags)), b""
    start = 128 + 4 + 12 * len(tags)
    for name, tag in tags.items():
        table += struct.pack(">4sII", name, start + len(data), len(tag))
        data += tag
    head = struct.pack(">I", start + len(data)).ljust(16, b"\0") + b"RGB XYZ "
    return head.ljust(128, b"\0") + table + data


SRGB_ICC = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
GAMMA = [chunk(b"gAMA", struct.pack(">I", n)) for n in (45455, 100000, 40000)]
CHRM = [
    chunk(b"cHRM", struct.pack(">8I", *(round(1e5 * n) for n in (*p[6:], *p[:6]))))
    for p in (BT709, P3)
]
SRGB = chunk(b"sRGB", b"\0")


@pytest.mark.parametrize(
    ("chunks", "words"),
    [
        ([], ""),
        ([GAMMA[0], CHRM[0]], ""),
        ([SRGB, GAMMA[1], CHRM[1]], ""),  # sRGB comes before what it replaces
        ([GAMMA[1]], "gAMA 1 is not applied, as in Mitsuba"),
        ([GAMMA[2]], "gAMA 0.4 is not applied"),
        ([CHRM[1]], "cHRM 0.3127, 0.329, 0.68, 0.32, 0.265, 0.69, 0.15, 0.06 is not"),
        ([profile_chunk(SRGB_ICC)], ""),
        ([profile_chunk(icc(2.2))], ""),
        ([profile_chunk(icc(1.0), b"linear sRGB"), SRGB], 'profile "linear sRGB", is not'),
        ([profile_chunk(icc(2.2, np.eye(3)))], 'profile "mine", is not applied'),
        ([profile_chunk(b"nonsense" * 40)], 'iCCP, profile "mine", is not applied'),
        ([chunk(b"iCCP", b"torn\0\0????")], 'iCCP, profile "torn", is not applied'),
        ([chunk(b"cICP", bytes((9, 16, 0, 1))), SRGB], "cICP 9, 16, 0, 1 is not applied"),
        ([chunk(b"cICP", bytes((1, 13, 0, 1))), GAMMA[1]], ""),
    ],
)
@pytest.mark.parametrize("depth", [8, 16])
def test_colour_spaces_of_png_are_named(
    tmp_path: Path, chunks: list[bytes], words: str, depth: int
) -> None:
    """Mitsuba takes all PNG as sRGB; so do we, and say when the file says otherwise."""
    path = png(tmp_path / "a.png", *chunks, depth=depth)
    found, warnings = read(path)
    np.testing.assert_allclose(found, mitsubas(path), atol=2e-6)
    assert len(warnings) == bool(words)
    assert not words or words in warnings[0]


def exif(orientation: int, color_space: int = 1) -> bytes:
    block = Image.Exif()
    block[0x0112] = orientation
    block.get_ifd(0x8769)[0xA001] = color_space
    return block.tobytes()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({}, ""),
        ({"exif": exif(1)}, ""),
        ({"exif": exif(6)}, "EXIF orientation 6 is not applied, as in Mitsuba"),
        ({"exif": exif(1, 2)}, "EXIF colour space (Adobe RGB) is not applied"),
        ({"exif": b"Exif\0\0MM\0*\0\0\0\x08\0\xff"}, ""),
        ({"icc_profile": SRGB_ICC}, ""),
        ({"icc_profile": icc(1.0)}, "ICC profile of the JPEG is not applied, as in"),
    ],
)
def test_what_jpeg_says_is_named(tmp_path: Path, more: dict[str, Any], words: str) -> None:
    path = tmp_path / "a.jpg"
    large = np.kron(BYTES, np.ones((8, 8, 1), np.uint8))
    Image.fromarray(large).save(path, quality=95, **more)
    found, warnings = read(path)
    assert found.shape == (8 * HEIGHT, 8 * WIDTH, 3)
    assert np.abs(found - mitsubas(path)).mean() < 1e-3  # decoders round in two ways
    assert len(warnings) == bool(words)
    assert not words or words in warnings[0]


def test_orientation_of_a_png_is_named(tmp_path: Path) -> None:
    path = png(tmp_path / "a.png", chunk(b"eXIf", exif(3).removeprefix(b"Exif\0\0")))
    assert "EXIF orientation 3" in str(read(path)[1])


def test_where_mitsuba_takes_the_pixels_of_bmp_and_tga_otherwise(tmp_path: Path) -> None:
    """What it gets wrong we get right, so that the pictures differ: that is said."""
    image = Image.fromarray(BYTES)
    image.quantize(8).save(tmp_path / "palette.bmp")
    image.save(tmp_path / "a.tga")
    content = bytearray((tmp_path / "a.tga").read_bytes())
    content[17] |= 0x10
    (tmp_path / "mirrored.tga").write_bytes(content)
    image.save(tmp_path / "a.bmp")
    for name, words in (
        ("palette.bmp", "Mitsuba takes its indices as greys"),
        ("mirrored.tga", "Mitsuba shows it mirrored"),
    ):
        found, warnings = read(tmp_path / name)
        assert found.shape == (HEIGHT, WIDTH, 3)
        assert len(warnings) == 1 and words in warnings[0]
    assert read(tmp_path / "a.bmp")[1] == read(tmp_path / "a.tga")[1] == ()


@pytest.mark.parametrize("name", ["chromaticities", "pixelAspectRatio", "envmap"])
def test_attributes_of_another_type_are_one_line(tmp_path: Path, name: str) -> None:
    path = write_exr(tmp_path / "a.exr", colors(), **{"x" * len(name): "words"})
    content = path.read_bytes().replace(b"x" * len(name) + b"\0", name.encode() + b"\0")
    path.write_bytes(content)
    try:
        read(path)
    except renderer.SceneError as error:
        assert "a.exr: damaged EXR file: " in str(error)


def test_damaged_pixels_are_one_line(tmp_path: Path, capfd) -> None:
    """What OpenEXR itself says of a chunk does not reach the terminal."""
    path = write_exr(tmp_path / "a.exr", colors())
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(renderer.SceneError, match=r"a\.exr: damaged EXR file: "):
        read(path)
    assert capfd.readouterr() == ("", "")


def test_damaged_attributes_end_in_a_picture_or_one_line(tmp_path: Path) -> None:
    """Each byte of what is not pixels is changed in turn, and each file is cut there."""
    write_exr(tmp_path / "a.exr", colors("RGB", "f2"), chromaticities=P3)
    png(tmp_path / "a.png", profile_chunk(icc(2.2)), chunk(b"eXIf", exif(3)[6:]), CHRM[1])
    large = Image.fromarray(np.kron(BYTES, np.ones((8, 8, 1), np.uint8)))
    large.save(tmp_path / "a.jpg", exif=exif(6), icc_profile=icc(2.2))
    hdr(tmp_path / "a.hdr", b"EXPOSURE=2\nPRIMARIES=1 0 0 1 0 0 0.3 0.3\n")
    for path in list(tmp_path.iterdir()):
        content = path.read_bytes()
        for place in range(4, min(len(content), 500), 7):
            wrong = bytearray(content)
            wrong[place] ^= 0x5A
            for found in (wrong, content[:place]):
                path.write_bytes(found)
                try:
                    pixels, warnings = read(path)
                    assert np.isfinite(pixels).all()
                    assert all(line.isprintable() for line in warnings)
                except renderer.SceneError as error:
                    assert path.name in str(error)


# -------------------------------------------------------------------- Radiance pictures


def hdr(path: Path, header: bytes, kind: bytes = b"32-bit_rle_rgbe") -> Path:
    pixels = RNG.integers(0, 256, (HEIGHT, WIDTH, 4), dtype=np.uint8)
    pixels[..., 3] = 128
    size = b"\n\n-Y %d +X %d\n" % (HEIGHT, WIDTH)
    path.write_bytes(b"#?RADIANCE\n" + header + b"FORMAT=" + kind + size + pixels.tobytes())
    return path


@pytest.mark.parametrize("kind", [b"32-bit_rle_rgbe", b"32-bit_rle_xyze"])
@pytest.mark.parametrize(
    ("header", "words"),
    [
        (b"", ""),
        (b"EXPOSURE=1.0\nPIXASPECT=1\nSOFTWARE=me\nVIEW=-vtl\n", ""),
        (b"EXPOSURE=2\nEXPOSURE=0.5\n", ""),  # they multiply
        (b"EXPOSURE=0.5\n", "EXPOSURE=0.5 of the HDR file is not applied, as in Mitsuba"),
        (b"EXPOSURE=2\nEXPOSURE=3\n", "EXPOSURE=2, 3 of the HDR file is not applied"),
        (b"EXPOSURE=two\n", "EXPOSURE=two of the HDR file is not applied"),
        (b"COLORCORR=1 0.5 1\n", "COLORCORR=1 0.5 1 of the HDR file is not applied"),
        (b"GAMMA=2.2\n", "GAMMA=2.2 of the HDR file is not applied"),
        (b"PIXASPECT=0.5\n", "PIXASPECT=0.5 of the HDR file is not applied"),
        (b"PRIMARIES=0.68 0.32 0.265 0.69 0.15 0.06 0.3127 0.329\n", "PRIMARIES=0.68 "),
        (b"PRIMARIES=0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329\n", ""),
    ],
)
def test_what_radiance_pictures_say_is_named(
    tmp_path: Path, header: bytes, words: str, kind: bytes
) -> None:
    path = hdr(tmp_path / "a.hdr", header, kind)
    found, warnings = read(path)
    np.testing.assert_allclose(found, mitsubas(path), atol=2e-6)
    warnings = tuple(line for line in warnings if "reflectances up to" not in line)
    warnings = tuple(line for line in warnings if "are negative" not in line)
    assert len(warnings) == bool(words)
    assert not words or words in warnings[0]


# ------------------------------------------------------------------- pixels below zero


def test_negative_pixels_are_kept_and_counted(tmp_path: Path) -> None:
    """As in Mitsuba: wide primaries and filters with lobes make them."""
    values = CHANNELS["R"].copy()
    values[1, 2], values[3, 0] = -0.25, -0.5
    path = write_exr(tmp_path / "a.exr", {"R": values, **colors("GB")})
    found, warnings = read(path)
    np.testing.assert_array_equal(found, mitsubas(path))
    assert len(warnings) == 1
    assert "a.exr: 2 of 20 pixels are negative, down to -0.5" in warnings[0]


def test_heights_may_be_negative(tmp_path: Path) -> None:
    """A bump map is no colour, so nothing is said."""
    path = write_exr(tmp_path / "a.exr", {"Y": CHANNELS["Y"] - 1})
    text = (
        '<shape type="rectangle"><bsdf type="bumpmap"><texture type="bitmap"><string '
        f'name="filename" value="{path.name}"/>{RAW}</texture><bsdf type="diffuse"/>'
        "</bsdf></shape>"
    )
    assert ours(text, folder=tmp_path).warnings == ()


# ----------------------------------------------------------------- pixels of dictionaries

GREY = CHANNELS["Y"]


def in_dictionary(**pixels: Any) -> Any:
    texture = {"type": "bitmap", **pixels}
    scene = {"type": "scene", "camera": {"type": "perspective"}}
    scene["shape"] = {
        "type": "rectangle",
        "bsdf": {"type": "diffuse", "reflectance": texture},
    }
    return renderer.load_dict(scene).description.shapes[0].bsdf.reflectance


@pytest.mark.parametrize(
    "values",
    [
        GREY,
        GREY[:, :, None],
        np.dstack([GREY, GREY]),
        np.dstack([GREY, GREY**2, GREY, GREY]),
        np.asfortranarray(np.dstack([GREY, GREY**2, GREY]))[::-1, ::2],
        *(GREY.astype(kind) for kind in ("f2", "f8")),
        *((255 * GREY).astype("u1"), (65535 * GREY).astype("u2")),
        np.ones((4, 4), np.float32),  # no transform
    ],
    ids=lambda values: f"{values.shape} {values.dtype}",
)
@pytest.mark.parametrize("raw", [False, True])
def test_bitmaps_of_any_shape_and_type(values: np.ndarray, raw: bool) -> None:
    """The array of a grey `mi.Bitmap` has two dimensions."""
    theirs = mi.Bitmap(np.ascontiguousarray(values))
    texture = mi.load_dict({"type": "bitmap", "bitmap": theirs, "raw": raw})
    expected = np.array(mi.traverse(texture)["data"])
    for given in (theirs, values):
        mine = in_dictionary(bitmap=given, raw=raw)
        assert mine.texels.dtype == expected.dtype
        np.testing.assert_array_equal(mine.texels[::-1], expected)


@pytest.mark.parametrize("kind", ["f2", "f4", "u2"])
@pytest.mark.parametrize("raw", [False, True])
def test_bitmaps_that_say_how_they_are_encoded(kind: str, raw: bool) -> None:
    values = 65535 * GREY if kind == "u2" else GREY
    theirs = mi.Bitmap(values.astype(kind))
    theirs.set_srgb_gamma(True)
    mine = in_dictionary(bitmap=theirs, raw=raw)
    texture = mi.load_dict({"type": "bitmap", "bitmap": theirs, "raw": raw})
    expected = np.array(mi.traverse(texture)["data"])
    assert mine.texels.dtype == expected.dtype
    np.testing.assert_allclose(
        mine.texels[::-1], expected, atol=1e-3 if kind != "f4" else 2e-6
    )


@pytest.mark.parametrize("srgb", [False, True])
def test_bitmaps_of_xyz(srgb: bool) -> None:
    theirs = mi.Bitmap(np.dstack([GREY, GREY**2, 0.5 * GREY]), mi.Bitmap.PixelFormat.XYZ)
    theirs.set_srgb_gamma(srgb)
    texture = mi.load_dict({"type": "bitmap", "bitmap": theirs})
    mine = in_dictionary(bitmap=theirs)
    expected = np.array(mi.traverse(texture)["data"])
    np.testing.assert_allclose(mine.texels[::-1], expected, atol=2e-6)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (GREY > 0.5, "the pixels are of type bool; expected uint8, uint16, float16"),
        ((100 * GREY).astype(np.int32), "the pixels are of type int32; expected uint8"),
        (GREY.astype(complex), "the pixels are of type complex128"),
        (np.zeros((0, 4)), "the image has the shape (0, 4, 1)"),
        (np.full((2, 2), np.nan), "NaN or infinite pixels, 4 of 4"),
        (np.full((2, 2), 1e300), "NaN or infinite pixels, 4 of 4"),
        (GREY[0], "found a ndarray of shape (5,); expected a number, string"),
    ],
    ids=range(7),
)
def test_arrays_that_are_no_pictures(values: np.ndarray, message: str) -> None:
    with pytest.raises(renderer.SceneError) as caught:
        in_dictionary(bitmap=values)
    assert message in str(caught.value)


@pytest.mark.parametrize("channels", [2, 4])
def test_a_tensor_has_no_alpha(channels: int) -> None:
    """As in Mitsuba; of a bitmap it is dropped."""
    with pytest.raises(renderer.SceneError, match="channels; expected 1 or 3"):
        in_dictionary(data=np.dstack([GREY] * channels))
    with pytest.raises(RuntimeError, match="Unsupported tensor channel count"):
        mi.load_dict({"type": "bitmap", "data": mi.TensorXf(np.dstack([GREY] * channels))})


def test_a_multi_channel_bitmap_is_refused_by_its_name() -> None:
    theirs = mi.Bitmap(np.dstack([GREY] * 3), mi.Bitmap.PixelFormat.MultiChannel)
    with pytest.raises(renderer.SceneError, match="pixel format is MULTICHANNEL"):
        in_dictionary(bitmap=theirs)


def test_an_environment_from_a_bitmap() -> None:
    """Grey, as in the case that failed for textures; Mitsuba's envmap takes them too."""
    scene = {"type": "scene", "camera": {"type": "perspective"}}
    scene["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(GREY)}
    found = renderer.load_dict(scene).description.emitters[0].pixels
    np.testing.assert_array_equal(found, np.dstack([GREY] * 3))

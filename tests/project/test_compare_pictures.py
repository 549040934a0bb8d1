"""`lightproof --compare A B`: equal pixels have one sentence, others their differences."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from image_files import write_exr
from PIL import Image as pillow

import renderer
from renderer.command.cli import main
from renderer.command.compare_pictures import EQUAL

pytestmark = pytest.mark.usefixtures("in_an_empty_folder")

SCENES = Path(__file__).parents[2] / "scenes"
NAN, INF = float("nan"), float("inf")


def compared(capsys, first, second, *words):
    """Return the status, and the lines on both streams together."""
    status = main(["--compare", str(first), str(second), *words])
    said = capsys.readouterr()
    assert (said.err == "") == (status == 0 or said.out != ""), said
    return status, (said.out + said.err).splitlines()


def save(name, pixels, **more):
    renderer.Image(np.asarray(pixels, np.float32), **more).save(name)
    return name


GREY = np.full((3, 4, 3), 0.5, np.float32)


def changed(row=0, column=0, channel=0, value=0.75):
    pixels = GREY.copy()
    pixels[row, column, channel] = value
    return pixels


def test_two_commands_with_the_same_pixels(capsys):
    """As for the lecture's accelerators: the files differ, and their pixels do not."""
    scene = [str(SCENES / "grey-furnace"), "-D", "width=8", "-D", "height=6", "--quiet"]
    for name, accel in (("a.exr", "brute"), ("b.exr", "bvh")):
        assert main([*scene, "--accel", accel, "-o", name]) == 0
    sums = {hashlib.md5(Path(name).read_bytes()).digest() for name in ("a.exr", "b.exr")}
    assert len(sums) == 2
    assert compared(capsys, "a.exr", "b.exr") == (0, [EQUAL])
    assert main(["--compare", "a.exr", "b.exr", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    assert main([*scene, "--seed", "1", "-o", "c.npy", "-o", "c.png", "-o", "c.exr"]) == 0
    status, lines = compared(capsys, "a.exr", "c.npy")
    assert status == 1 and lines[0].startswith("different: ")
    for name in ("c.npy", "c.exr"):
        assert compared(capsys, "c.exr", name) == (0, [EQUAL])
    assert main(["--compare", "a.exr", "c.exr", "--quiet"]) == 1
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("pixels", "line"),
    [
        (
            changed(2, 3, 1),
            "  G: 1 pixel, by at most 0.25 at column 3, row 2: 0.5 and 0.75",
        ),
        (changed(value=NAN), "  R: 1 pixel, such as at column 0, row 0: 0.5 and nan"),
        (changed(value=-INF), "  R: 1 pixel, such as at column 0, row 0: 0.5 and -inf"),
        (
            changed(value=np.nextafter(np.float32(0.5), np.float32(1))),
            "  R: 1 pixel, by at most 5.96046e-08 at column 0, row 0: 0.5 and 0.50000006",
        ),
    ],
)
@pytest.mark.parametrize("ending", [".exr", ".npy"])
def test_how_many_pixels_differ_by_how_much_and_where(capsys, pixels, line, ending):
    first, second = save(f"a{ending}", GREY), save(f"b{ending}", pixels)
    assert compared(capsys, first, second) == (1, ["different: 1 of 12 pixels", line])
    assert compared(capsys, second, second) == (0, [EQUAL])


def test_the_bits_decide(capsys):
    """Zero has two signs; NaN is equal to itself."""
    first = save("a.exr", changed(value=0.0))
    second = save("b.exr", changed(value=-0.0))
    status, lines = compared(capsys, first, second)
    assert status == 1 and "in bits that do not change the value" in lines[1]
    assert lines[1].endswith("column 0, row 0: 0.0 and -0.0")
    save("nan.npy", changed(value=NAN))
    assert compared(capsys, "nan.npy", "nan.npy") == (0, [EQUAL])


def test_every_channel_counts_and_a_pixel_once(capsys):
    """AOVs too; a pixel that differs in two channels is one pixel."""
    depth = np.ones((3, 4, 1), np.float32)
    first = save("a.exr", GREY, aovs={"d": depth}, aov_kinds={"d": "depth"})
    pixels = changed(1, 1, 0)
    pixels[1, 1, 2] = 0.0
    other = depth.copy()
    other[2, 0] = 5.0
    second = save("b.exr", pixels, aovs={"d": other}, aov_kinds={"d": "depth"})
    assert compared(capsys, first, second) == (
        1,
        [
            "different: 2 of 12 pixels",
            "  B: 1 pixel, by at most 0.5 at column 1, row 1: 0.5 and 0.0",
            "  R: 1 pixel, by at most 0.25 at column 1, row 1: 0.5 and 0.75",
            "  d.T: 1 pixel, by at most 4 at column 0, row 2: 1.0 and 5.0",
        ],
    )
    assert compared(capsys, second, second) == (0, [EQUAL])


def test_png_levels_are_compared_as_they_are(capsys):
    """Another packing of the same levels is equal; a palette is looked up."""
    levels = np.arange(36, dtype=np.uint8).reshape(3, 4, 3)
    pillow.fromarray(levels).save("a.png", compress_level=9)
    pillow.fromarray(levels).save("b.png", compress_level=0)
    assert Path("a.png").read_bytes() != Path("b.png").read_bytes()
    assert compared(capsys, "a.png", "b.png") == (0, [EQUAL])
    levels[2, 1, 2] = 255
    pillow.fromarray(levels).save("b.png")
    line = "  B: 1 pixel, by at most 226 at column 1, row 2: 29 and 255"
    assert compared(capsys, "a.png", "b.png") == (1, ["different: 1 of 12 pixels", line])
    for name, color in (("p.png", (1, 2, 3)), ("q.png", (1, 2, 4))):
        palette = pillow.new("P", (2, 2))
        palette.putpalette(color)
        palette.save(name)
    assert compared(capsys, "p.png", "q.png")[0] == 1


def test_what_cannot_be_compared_is_one_line(capfd):
    """OpenEXR's own lines about a damaged file, of its C code, are not seen."""
    save("a.exr", GREY)
    save("a.npy", GREY)
    save("wide.exr", np.zeros((3, 5, 3)))
    save("aov.exr", GREY, aovs={"d": GREY[..., :1]}, aov_kinds={"d": "depth"})
    save("a.png", GREY)
    write_exr("half.exr", {name: GREY[..., 0].astype(np.float16) for name in "RGB"})
    np.save("line.npy", np.zeros(3))
    np.save("text.npy", np.array(["a"]))
    np.save("long.npy", GREY.astype(np.longdouble))
    np.save("empty.npy", np.zeros((0, 3, 3), np.float32))
    np.savez("many.npz", a=GREY)
    Path("many.npz").rename("many.npy")
    Path("damaged.exr").write_bytes(Path("a.exr").read_bytes()[:-40])
    save("cut.exr", np.random.default_rng(1).random((99, 9, 3)))  # of several chunks
    Path("cut.exr").write_bytes(Path("cut.exr").read_bytes()[:-30])
    Path("damaged.png").write_bytes(Path("a.png").read_bytes()[:-30])
    Path("damaged.npy").write_bytes(Path("a.npy").read_bytes()[:-40])
    Path("text.png").write_text("no picture")
    Path("a.jpg").write_text("no picture")
    pillow.fromarray(np.zeros((3, 4), np.uint16)).save("grey16.png")
    sixteen = bytearray(Path("a.png").read_bytes())
    sixteen[24] = 16  # bits of a level
    Path("sixteen.png").write_bytes(sixteen)
    for other, said in {
        "wide.exr": "a.exr has 4 x 3 pixels, wide.exr has 5 x 3; equal sizes are needed",
        "aov.exr": "aov.exr has the channels d.T, which a.exr has not; that has ",
        "half.exr": "is float32 in a.exr and float16 in half.exr",
        "a.png": "is float32 in a.exr and uint8 in a.png",
        "grey16.png": "a.exr has the channels ",
        "line.npy": "line.npy: an array of shape (3,); expected (height, width, channels)",
        "text.npy": "text.npy: holds no array of numbers",
        "long.npy": "long.npy: holds no array of numbers of 8 to 64 bits",
        "many.npy": "many.npy: holds no array of numbers",
        "empty.npy": "empty.npy: there are no pixels in it",
        "damaged.exr": "damaged.exr: cannot be read: ",
        "cut.exr": "cut.exr: cannot be read: its pixels are damaged",
        "damaged.png": "damaged.png: cannot be read: ",
        "damaged.npy": "damaged.npy: cannot be read: ",
        "text.png": "text.png: cannot be read: ",
        "sixteen.png": "sixteen.png: a PNG with colours of 16 bits",
        "a.jpg": "a.jpg: the ending '.jpg'; pictures are compared as .exr, .npy or .png",
        "nowhere.exr": "nowhere.exr: no such picture",
        str(SCENES): "no ending",
    }.items():
        for pair in (("a.exr", other), (other, "a.exr")):
            assert main(["--compare", *pair]) == 1
            said_in_all = capfd.readouterr()
            (line,) = (said_in_all.out + said_in_all.err).splitlines()
            assert line.startswith("error: ")
            if pair[0] == "a.exr":
                assert said in line, line


@pytest.mark.parametrize(
    "words",
    [
        ["--compare", "a.exr"],
        ["--compare", "a.exr", "b.exr", "c.exr"],
        ["scene.xml", "--compare", "a.exr", "b.exr"],
        ["--compare", "a.exr", "b.exr", "-o", "c.exr"],
        ["--compare", "a.exr", "b.exr", "--spp", "3"],
    ],
)
def test_it_stands_alone(words, capsys):
    """A word that would be without effect is an error."""
    assert main(words) == 2
    assert "--compare" in capsys.readouterr().err
    assert main([]) == 2
    assert "arguments are required: SCENE.xml" in capsys.readouterr().err

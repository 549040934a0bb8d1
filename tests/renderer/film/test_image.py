"""The image type: files that come back as they were, and failures that leave no trace."""

from __future__ import annotations

import io
import warnings

import mitsuba as mi
import numpy as np
import OpenEXR
import PIL.Image
import pytest

from renderer.errors import SceneError
from renderer.rendering.picture.image import Image
from renderer.rendering.picture.image_files import (
    aov_channel_names,
    check_output_path,
)
from renderer.scene_file.description import AOV_KINDS

mi.set_variant("scalar_rgb")


def pixels_of(*rgb):
    """Make a picture of one row with the given colours."""
    return np.array([rgb], dtype=np.float32)


@pytest.fixture
def image():
    """3 x 5 pixels from below 0 to above 1, with one AOV of each width."""
    generator = np.random.default_rng(1)
    return Image(
        generator.uniform(-2.0, 50.0, (5, 3, 3)).astype(np.float32),
        aovs={
            "dist": generator.random((5, 3, 1), dtype=np.float32),
            "n": generator.random((5, 3, 3), dtype=np.float32),
            "st": generator.random((5, 3, 2), dtype=np.float32),
        },
        aov_kinds={"dist": "depth", "n": "sh_normal", "st": "uv"},
        spp=16,
        metadata={"lightproof": "0.1.0"},
    )


def test_exr_keeps_every_bit(image, tmp_path):
    """Float32 in, the same float32 out, below 0 and above 1, AOVs and header included."""
    image.save(tmp_path / "a.exr")
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        channels = {name: c.pixels for name, c in file.channels().items()}
        header = dict(file.header())
    for c, name in enumerate("RGB"):
        np.testing.assert_array_equal(channels[name], image.pixels[..., c])
        assert channels[name].dtype == np.float32
    np.testing.assert_array_equal(channels["dist.T"], image.aovs["dist"][..., 0])
    np.testing.assert_array_equal(channels["n.Y"], image.aovs["n"][..., 1])
    np.testing.assert_array_equal(channels["st.V"], image.aovs["st"][..., 1])
    assert header["spp"] == 16
    assert header["lightproof"] == "0.1.0"


def test_aov_channels_are_named_as_mitsuba_names_them():
    """Same names for every kind, so that a viewer or script serves both renderers."""
    listed = ",".join(f"my_{kind}:{kind}" for kind in AOV_KINDS)
    theirs = mi.load_dict({"type": "aov", "aovs": listed}).aov_names()
    counts = {"albedo": 3, "uv": 2, "depth": 1, "prim_index": 1, "shape_index": 1}
    ours = [
        name
        for kind in AOV_KINDS
        for name in aov_channel_names(f"my_{kind}", kind, counts.get(kind, 3))
    ]
    assert ours == theirs


def test_an_aov_of_unknown_kind_still_gets_names():
    """By the number of its channels, then by numbers; never two the same."""
    assert aov_channel_names("a", "", 2) == ["a.U", "a.V"]
    assert aov_channel_names("a", "", 5) == ["a.0", "a.1", "a.2", "a.3", "a.4"]


def test_npy_is_the_pixels(image, tmp_path):
    """The simplest format holds exactly the array that the API gives."""
    image.save(tmp_path / "a.npy")
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), np.asarray(image))


def test_png_is_the_nearest_srgb_level(tmp_path):
    """Known levels: linear 0.5 is 188, the linear toe 0.001 is 3; outside is clipped."""
    pixels = pixels_of((0.0, 0.5, 1.0), (-1.0, 0.001, 7.0))
    Image(pixels).save(tmp_path / "a.PNG")
    with PIL.Image.open(tmp_path / "a.PNG") as file:
        levels = np.asarray(file)
    np.testing.assert_array_equal(levels, [[[0, 188, 255], [0, 3, 255]]])


def test_png_says_how_many_pixels_are_broken_and_shows_them(tmp_path):
    """NaN must be seen: a count in a warning, and a colour that no scene has."""
    pixels = pixels_of((np.nan, 0.0, 0.0), (0.2, 0.2, 0.2), (0.0, np.inf, 0.0))
    with pytest.warns(RuntimeWarning, match="2 of 3 pixels are NaN or infinite"):
        Image(pixels).save(tmp_path / "a.png")
    with PIL.Image.open(tmp_path / "a.png") as file:
        levels = np.asarray(file)
    assert levels[0, 0].tolist() == levels[0, 2].tolist() == [255, 0, 255]
    assert levels[0, 1].tolist() == [124, 124, 124]


def test_an_interrupted_write_leaves_nothing(tmp_path, monkeypatch):
    """Ctrl-C in the middle of a write is not an error to hide, and leaves no file."""

    def interrupted(source, target):
        raise KeyboardInterrupt

    monkeypatch.setattr("os.replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        Image(pixels_of((1.0, 1.0, 1.0))).save(tmp_path / "a.npy")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.jpg", r"the ending '\.jpg'; pictures are written as \.exr, \.png or \.npy"),
        ("a", "no ending"),
        ("missing/a.png", "there is no folder"),
        ("folder.png", "is a folder"),
    ],
)
def test_an_impossible_path_is_refused_before_anything_is_written(name, message, tmp_path):
    """One line that says what is possible; also for the check before a long render."""
    (tmp_path / "folder.png").mkdir()
    for refuse in (check_output_path, Image(pixels_of((0.0, 0.0, 0.0))).save):
        with pytest.raises(SceneError, match=message):
            refuse(tmp_path / name)
    assert [p.name for p in tmp_path.iterdir()] == ["folder.png"]


def test_numpy_sees_the_pixels(image):
    """`np.asarray` shares the memory, other types convert, `copy` is honoured."""
    assert np.shares_memory(np.asarray(image), image.pixels)
    assert not np.shares_memory(np.array(image), image.pixels)
    assert np.asarray(image, dtype=np.float64).dtype == np.float64
    assert np.mean(image) == pytest.approx(image.pixels.mean())


def test_a_notebook_shows_the_picture(image):
    """PNG bytes of the right size, an HTML figure around them, and no warning for NaN."""
    broken = Image(np.full((2, 4, 3), np.nan, dtype=np.float32))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with PIL.Image.open(io.BytesIO(broken._repr_png_())) as shown:
            assert shown.size == (4, 2)
        assert 'src="data:image/png;base64,' in broken._repr_html_()
    assert repr(image) == "<Image 3 x 5, 16 samples per pixel, 0.00 s, AOVs dist, n, st>"
    assert "&lt;b&gt;" in Image(image.pixels, aovs={"<b>": image.pixels})._repr_html_()


@pytest.mark.parametrize(
    "arrays",
    [
        {"pixels": np.zeros((2, 2), np.float32)},
        {"pixels": np.zeros((2, 2, 4), np.float32)},
        {"pixels": np.zeros((2, 3, 3), np.float32), "aovs": {"a": np.zeros((3, 2, 1))}},
    ],
)
def test_shapes_that_do_not_belong_together_are_refused(arrays):
    """A mistake in the renderer shows here and not as a skewed file."""
    with pytest.raises(ValueError, match="shape"):
        Image(**arrays)

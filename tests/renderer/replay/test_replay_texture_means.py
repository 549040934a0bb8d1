"""Means of bitmaps in a replay: sums in single precision, as Mitsuba's to the bit."""

import numpy as np
import pytest
from PIL import Image

import renderer
from renderer.replay.light_rounding import rounded_mean, rounded_shares

mi = pytest.importorskip("mitsuba")
mi.set_variant("scalar_rgb")
SIZE = 700  # so many texels that a sum of 24 bits drifts by 1e-4


def texels(channels):
    rng = np.random.default_rng(8)
    shape = (SIZE, SIZE, channels) if channels > 1 else (SIZE, SIZE)
    return np.uint8(255.0 * rng.random(shape) ** 2)


def plastic(**texture):
    """A description of a plastic sphere with this diffuse reflectance."""
    bsdf = {"type": "plastic", "diffuse_reflectance": {"type": "bitmap", **texture}}
    content = {"type": "scene", "camera": {"type": "perspective"}}
    return renderer.load_dict(content | {"ball": {"type": "sphere", "bsdf": bsdf}})


@pytest.mark.parametrize("raw", [False, True])
@pytest.mark.parametrize("channels", [1, 3])
def test_means_are_mitsubas(tmp_path, channels, raw):
    """Of bytes, decoded or as they are."""
    path = str(tmp_path / "texels.png")
    Image.fromarray(texels(channels)).save(path)
    scene = plastic(filename=path, raw=raw)
    (bsdf,) = scene.materials.bsdfs
    texture = bsdf.diffuse_reflectance
    theirs = mi.load_dict({"type": "bitmap", "filename": path, "raw": raw}).mean()
    assert np.float32(rounded_mean(texture)) == np.float32(theirs)
    read, rounded = scene.materials.values(), rounded_shares(scene.materials)
    (row,) = np.flatnonzero((read != rounded).any(axis=1))
    assert scene.materials.kinds[0].layout()[3][:2] == ("specular_share", row)
    np.testing.assert_allclose(rounded[row, 0], 1.0 / (1.0 + theirs), rtol=1e-7)


def test_a_mean_of_squares_is_made_of_those_of_their_bitmaps(tmp_path):
    """The colours of a checkerboard are textures of their own."""
    path = str(tmp_path / "texels.png")
    Image.fromarray(texels(3)).save(path)
    board = {"type": "checkerboard", "color0": {"type": "bitmap", "filename": path}}
    theirs = mi.load_dict(board).mean()
    bsdf = {"type": "plastic", "diffuse_reflectance": board}
    content = {"type": "scene", "camera": {"type": "perspective"}}
    scene = renderer.load_dict(content | {"ball": {"type": "sphere", "bsdf": bsdf}})
    mean = rounded_mean(scene.materials.bsdfs[0].diffuse_reflectance)
    assert mean == pytest.approx(theirs, rel=1e-6)


def test_a_wrong_share_stays_wrong(tmp_path):
    """What does not follow from the exact means is a defect, which a replay has to find."""
    path = str(tmp_path / "texels.png")
    Image.fromarray(texels(3)).save(path)
    materials = plastic(filename=path).materials
    right, read = rounded_shares(materials), materials.values()
    (row,) = np.flatnonzero((read != right).any(axis=1))
    spoiled = read.copy()
    spoiled[row] *= 1.0001
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(type(materials), "values", lambda _: spoiled.copy())
        assert (rounded_shares(materials) == spoiled).all()
